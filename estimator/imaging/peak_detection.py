"""Peaks of an image that stand out of its background."""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import maximum_filter

FALSE_ALARM = 1e-6
"""Probability that a pixel of pure background counts as significant. [-]."""


DYNAMIC_RANGE = 3e-5
"""Intensity below the image's peak that may be a sidelobe of it (−45 dB). [-]."""


MOST_PEAKS = 400
"""Strongest peaks searched: the search is over all their pairs."""


def significant_peaks(
    intensity: Float[np.ndarray, "rows columns"], points: Float[np.ndarray, "rows columns 3"]
) -> Float[np.ndarray, "peaks 3"]:
    """Return the local maxima that stand out of the background, strongest first.

    Parameters
    ----------
    intensity
        Squared magnitude of an image that is sampled at about half its resolution.
    points
        Its pixels. [m]

    Returns
    -------
    Where the peaks are [m]; the background is taken to be exponentially distributed, with
    the image's median.
    """
    background = mean_background(intensity)
    threshold = max(-np.log(FALSE_ALARM) * background, DYNAMIC_RANGE * float(intensity.max()))
    rows, columns = np.nonzero(
        (intensity == maximum_filter(intensity, size=3)) & (intensity > threshold)
    )
    order = np.argsort(-intensity[rows, columns], kind="stable")[:MOST_PEAKS]
    return points[rows[order], columns[order]]


def mean_background(intensity: Float[np.ndarray, "*n"]) -> float:
    """Return the mean of an exponentially distributed background with this median."""
    return float(np.median(intensity)) / float(np.log(2))


def image_contrast(brightest: float, background: float) -> float:
    """Return the intensity of an image's brightest point over its background; 0 of no image."""
    if brightest == 0:
        return 0.0
    return brightest / background if background > 0 else np.inf
