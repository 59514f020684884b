"""What a linear array resolves, and between which ranges and angles it images."""

import numpy as np
from scipy.constants import speed_of_light

from estimator.array.resolution import unaliased_sine
from estimator.array.resolution_cell import Resolution
from estimator.measurement.model import Echo, MeasurementError, frequency_step


def echo_resolution(echo: Echo) -> Resolution:
    """Return c/2B along the ray and λ/2D across it, of an echo in the array's frame."""
    band = float(echo.frequencies[-1] - echo.frequencies[0])
    wavelength = speed_of_light / float(echo.frequencies.mean())
    aperture = float(np.ptp(echo.positions[:, 0]))
    return Resolution(along_ray=speed_of_light / (2 * band), across_ray=wavelength / (2 * aperture))


def echo_reach(echo: Echo) -> tuple[float, float]:
    """Return the distances between which an echo can be imaged. [m].

    From half the aperture to the unambiguous range c/2Δf, less the aperture.

    Raises
    ------
    MeasurementError
        If nothing is left between.
    """
    aperture = float(np.ptp(echo.positions[:, 0]))
    step = frequency_step(echo.frequencies)
    nearest, farthest = 0.5 * aperture, speed_of_light / (2 * step) - 1.1 * aperture
    if farthest < 2 * nearest:
        raise MeasurementError(
            f"frequency step {step / 1e6:.4g} MHz: the echo is unambiguous to "
            f"{speed_of_light / (2 * step):.3g} m only, less than twice the aperture of "
            f"{aperture:.3g} m; take smaller frequency steps"
        )
    return nearest, farthest


def imaged_sine(echo: Echo) -> float:
    """Return the largest |sin φ| that is imaged: without grating lobes, and short of endfire."""
    spacing = float(np.ptp(echo.positions[:, 0])) / (len(echo.positions) - 1)
    return min(0.95, unaliased_sine(spacing, speed_of_light / float(echo.frequencies[-1])))
