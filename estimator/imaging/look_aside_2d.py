"""A linear array's look around a direction beyond the angles without grating lobes.

There the image shows real scatterers and also grating lobes of scatterers elsewhere. A peak is
therefore no proof of a scatterer, but the absence of peaks shows that nothing is there.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.constants import speed_of_light

from estimator.array.linear_array import WIDEST_SINE, echo_reach, echo_resolution
from estimator.array.windows import survey_weights
from estimator.imaging.backprojection import backproject
from estimator.imaging.peak_detection import peak_threshold, peaks_above
from estimator.imaging.survey_2d import STEP, Survey, sector_points
from estimator.measurement.model import Echo

HALF_WIDTH = 0.4
"""Sine to either side of the direction that is looked at: a wall 30 cm long whose middle is
on the ray 0.4 m away ends within it. [-]"""
BAND = 9
"""Frequencies over the band at which a grating lobe's origin is looked for. [-]"""
LOBE = 4.0
"""Intensity at the origin of a grating lobe over that of the lobe, at least: over the band the lobe
is smeared, over some 30 cells for 30 % of bandwidth. [-]"""


def peaks_aside(
    echo: Echo, looked: Survey, heading: Float[np.ndarray, " 3"], farthest: float
) -> Float[np.ndarray, "peaks 3"] | None:
    """Find the peaks of the image around a direction that the survey does not show.

    Parameters
    ----------
    echo
        In the array's frame.
    looked
        Its survey.
    heading
        Unit vector.
    farthest
        To which distance. [m]

    Returns
    -------
    Peaks that no grating lobe explains, strongest first [m]; ``None`` if the direction is nearly
    along the array.
    """
    if abs(float(heading[0])) > WIDEST_SINE:
        return None
    resolution = echo_resolution(echo)
    nearest, reach = echo_reach(echo)
    ranges = np.arange(nearest, min(farthest, reach), STEP * resolution.along_ray)
    if ranges.size < 2:
        return np.zeros((0, 3))
    low = max(float(heading[0]) - HALF_WIDTH, -WIDEST_SINE)
    high = min(float(heading[0]) + HALF_WIDTH, WIDEST_SINE)
    count = int(np.ceil((high - low) / (STEP * resolution.across_ray))) + 2
    points = sector_points(ranges[:, None], np.linspace(low, high, count))
    taper = survey_weights(echo)
    intensity = np.abs(backproject(echo, points, weights=taper)) ** 2
    threshold = peak_threshold(looked.background, float(np.max(np.abs(looked.values) ** 2)))
    peaks, levels = peaks_above(intensity, points, threshold)
    real: np.ndarray = peaks[~_brighter_elsewhere(echo, peaks, levels)]
    return real


def _brighter_elsewhere(
    echo: Echo, peaks: Float[np.ndarray, "peaks 3"], levels: Float[np.ndarray, " peaks"]
) -> Bool[np.ndarray, " peaks"]:
    """Tell which peaks are grating lobes, at sine ± λ/2d, of something brighter."""
    far = np.linalg.norm(peaks, axis=-1)
    if not far.size:
        return np.zeros(0, dtype=bool)
    spacing = float(np.ptp(echo.positions[:, 0])) / (len(echo.positions) - 1)
    band = np.linspace(echo.frequencies[0], echo.frequencies[-1], BAND)
    shifts = speed_of_light / (2 * spacing * band)
    sines = (peaks[:, 0] / far)[:, None] + np.concatenate([shifts, -shifts])
    real = np.abs(sines) < WIDEST_SINE
    there = np.zeros(sines.shape)
    if real.any():
        ranges = np.broadcast_to(far[:, None], sines.shape)[real]
        origins = sector_points(ranges, sines[real])
        there[real] = np.abs(backproject(echo, origins, weights=survey_weights(echo))) ** 2
    lobes: np.ndarray = there.max(axis=1) > LOBE * levels
    return lobes
