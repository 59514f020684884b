"""Peaks of an image that stand out of its background."""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import maximum_filter

from estimator import false_alarm

DYNAMIC_RANGE = 3e-5
"""Intensity over the image's highest below which a peak may be its sidelobe (−45 dB): the survey's
taper has sidelobes of −50 dB, and errors of positions and gain add some. [-]"""

MOST_PEAKS = 400
"""Strongest peaks that are searched for lines: the search takes all their pairs, and the time of
pairs times peaks. A wall shows one peak for every cell or two. [-]"""


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
    threshold = peak_threshold(mean_background(intensity), float(intensity.max()))
    rows, columns = np.nonzero(
        (intensity == maximum_filter(intensity, size=3)) & (intensity > threshold)
    )
    order = np.argsort(-intensity[rows, columns], kind="stable")[:MOST_PEAKS]
    return points[rows[order], columns[order]]


def peak_threshold(background: float, highest: float) -> float:
    """Return the intensity from which a local maximum is neither noise nor a sidelobe.

    Parameters
    ----------
    background
        Mean intensity of what is no echo. [-]
    highest
        Intensity of the image's brightest pixel. [-]
    """
    return max(false_alarm.threshold(false_alarm.PIXEL) * background, DYNAMIC_RANGE * highest)


def mean_background(intensity: Float[np.ndarray, "*n"]) -> float:
    """Return the mean of an exponentially distributed background with this median."""
    return float(np.median(intensity)) / float(np.log(2))


def image_contrast(brightest: float, background: float) -> float:
    """Return the intensity of an image's brightest point over its background; 0 of no image."""
    if brightest == 0:
        return 0.0
    return brightest / background if background > 0 else np.inf
