"""A linear array's resolution cell, and the ranges and angles that it images unambiguously."""

import numpy as np
from scipy.constants import speed_of_light

from estimator.array.resolution import unaliased_sine
from estimator.array.resolution_cell import Resolution
from estimator.measurement.model import Echo, MeasurementError, frequency_step

WIDEST_SINE = 0.95
"""Largest sine of an angle off broadside that is imaged: 72°. There the cell across the ray is
three times as wide as at broadside, at 80° six times. [-]"""

NEAREST = 0.5
"""Least distance that is imaged, over the aperture: nearer, the ends of the array see a point at
more than 45° to either side, and its image has no one cell. [-]"""

REACH_MARGIN = 1.1
"""What the unambiguous range must exceed a distance by, over the aperture: the far end of the array
is half an aperture farther away, and profiles have sidelobes beyond. [-]"""

LEAST_DEPTH = 2.0
"""Farthest over nearest distance, below which there is nothing to image. [-]"""


def echo_resolution(echo: Echo) -> Resolution:
    """Return c/2B along the ray and λ/2D across it, of an echo in the array's frame."""
    band = float(echo.frequencies[-1] - echo.frequencies[0])
    wavelength = speed_of_light / float(echo.frequencies.mean())
    aperture = float(np.ptp(echo.positions[:, 0]))
    return Resolution(along_ray=speed_of_light / (2 * band), across_ray=wavelength / (2 * aperture))


def echo_reach(echo: Echo) -> tuple[float, float]:
    """Return the distances between which an echo can be imaged. [m].

    From half the aperture to the unambiguous range c/2Δf, less 1.1 apertures.

    Raises
    ------
    MeasurementError
        If nothing is left between.
    """
    aperture = float(np.ptp(echo.positions[:, 0]))
    step = frequency_step(echo.frequencies)
    nearest = NEAREST * aperture
    farthest = speed_of_light / (2 * step) - REACH_MARGIN * aperture
    if farthest < LEAST_DEPTH * nearest:
        raise MeasurementError(
            f"frequency step {step / 1e6:.4g} MHz: the echo is unambiguous to "
            f"{speed_of_light / (2 * step):.3g} m only, less than twice the aperture of "
            f"{aperture:.3g} m; take smaller frequency steps"
        )
    return nearest, farthest


def imaged_sine(echo: Echo) -> float:
    """Return the largest |sin φ| that is imaged: without grating lobes, and short of endfire."""
    spacing = float(np.ptp(echo.positions[:, 0])) / (len(echo.positions) - 1)
    unaliased = unaliased_sine(spacing, speed_of_light / float(echo.frequencies[-1]))
    return min(WIDEST_SINE, unaliased)
