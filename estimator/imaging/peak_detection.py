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
    return peaks_above(intensity, points, threshold)[0]


def peaks_above(
    intensity: Float[np.ndarray, "*pixels"],
    points: Float[np.ndarray, "*pixels 3"],
    threshold: float,
    *,
    most: int = MOST_PEAKS,
) -> tuple[Float[np.ndarray, "peaks 3"], Float[np.ndarray, " peaks"]]:
    """Return the local maxima above an intensity, strongest first, and their intensities.

    Parameters
    ----------
    intensity
        Squared magnitude of a plane or a volume.
    points
        Its pixels. [m]
    threshold
        What a maximum must exceed.
    most
        How many are returned at the most.

    Returns
    -------
    Places and intensities. [m], [-]
    """
    tops = (intensity == maximum_filter(intensity, size=3)) & (intensity > threshold)
    order = np.argsort(-intensity[tops], kind="stable")[:most]
    return points[tops][order], intensity[tops][order]


def vertex_shift(before: float, at: float, after: float) -> float:
    """Return the offset of the vertex of a parabola through three samples from the middle one.

    Parameters
    ----------
    before, at, after
        Values at equal steps.

    Returns
    -------
    In steps; 0 where the parabola has no vertex. [-]
    """
    bend = before - 2 * at + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


def peak_shift(values: Float[np.ndarray, " n"], index: int) -> float:
    """Return where a parabola through the logarithms around a maximum peaks, from its sample.

    Parameters
    ----------
    values
        Intensities at equal steps.
    index
        Of the maximum.

    Returns
    -------
    In steps, within half a one; 0 at an end, or beside a zero. [-]
    """
    if not 0 < index < values.size - 1 or values[index - 1 : index + 2].min() <= 0:
        return 0.0
    before, at, after = np.log(values[index - 1 : index + 2])
    return float(np.clip(vertex_shift(before, at, after), -0.5, 0.5))


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
