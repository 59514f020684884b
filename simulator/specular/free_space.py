"""The free-space link between two isotropic ports."""

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Waves


def direct_wave(
    distances: Float[np.ndarray, " elements"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    waves: Waves,
) -> Complex[np.ndarray, "elements freqs"]:
    r"""Free-space link between isotropic ports.

    Parameters
    ----------
    distances
        Lengths R. [m]
    frequencies
        [Hz]
    waves
        Spherical: :math:`\frac{\lambda}{4\pi R} e^{-jkR}`; cylindrical: the far form of
        :math:`-\frac{j}{4} H_0^{(2)}(kR)`, exact to 1/(8kR) (3e-5 at 1 m and 200 GHz).

    Returns
    -------
    S-parameter, or field of a unit line source. [-]
    """
    wavelengths = speed_of_light / frequencies
    phase = np.exp(-2j * np.pi * np.remainder(distances[:, None] / wavelengths, 1.0))
    if waves == "spherical":
        return np.asarray(wavelengths / (4 * np.pi * distances[:, None]) * phase)
    magnitude = np.sqrt(wavelengths / distances[:, None]) / (4 * np.pi)
    wave: np.ndarray = magnitude * np.exp(-0.25j * np.pi) * phase
    return wave
