r"""What air does to waves: specific attenuation, after ITU-R P.676-12, and refractivity.

Annex 1, line by line: :math:`\gamma = 0.1820 f (N''_O + N''_W)` in dB/km, f in GHz, with
:math:`N'' = \sum_i S_i F_i + N''_D`. The lines also delay: the real part of the same (complex) line
shape is :func:`line_refractivity`. The refractivity away from lines is written apart from the
estimator's, in the two-term form of Smith and Weintraub, Proc. IRE 41, 1953, which agrees with the
three terms of ITU-R P.453-14 to 0.02 %.
"""

import math

import numpy as np
from jaxtyping import Complex, Float

from scenes.schema.air import Air
from simulator.materials.spectral_lines import OXYGEN, WATER_VAPOUR

LOWEST, HIGHEST = 1e9, 1e12
"""Band in which P.676 holds. [Hz]"""


def vapour_pressure(air: Air) -> float:
    """Return the partial pressure of the water vapour, at most that of all air. [hPa]."""
    t = air.temperature_c
    # Buck's formula over water, with its enhancement by the air's pressure, as P.453-14 has it.
    saturated = 6.1121 * math.exp(t * (18.678 - t / 234.5) / (257.14 + t))
    saturated *= 1.00072 + air.pressure_hpa * (3.2e-6 + 5.9e-10 * t**2)
    return min(saturated * air.humidity_percent / 100, air.pressure_hpa)


def refractive_index(air: Air | None) -> float:
    """Return the index of air, by which frequencies are multiplied; 1 of vacuum. [-]."""
    if air is None:
        return 1.0
    kelvin = air.temperature_c + 273.15
    return 1 + 1e-6 * 77.6 / kelvin * (air.pressure_hpa + 4810 * vapour_pressure(air) / kelvin)


def attenuation_db_km(
    air: Air, frequencies: Float[np.ndarray, " freqs"]
) -> Float[np.ndarray, " freqs"]:
    """Return the specific attenuation by oxygen and water vapour. [dB/km].

    Parameters
    ----------
    air
        Temperature, pressure, humidity.
    frequencies
        From 1 to 1000 GHz. [Hz]

    Examples
    --------
    >>> attenuation_db_km(Air(temperature_c=15.0, humidity_percent=0.0), np.array([60e9])).round(1)
    array([14.7])
    """
    ghz = frequencies / 1e9
    kelvin = air.temperature_c + 273.15
    vapour, theta = vapour_pressure(air), 300 / kelvin
    dry = air.pressure_hpa - vapour
    width = 5.6e-4 * air.pressure_hpa * theta**0.8
    continuum = ghz * dry * theta**2 * 6.14e-5 / (width * (1 + (ghz / width) ** 2))
    continuum += ghz * dry * theta**2 * 1.4e-12 * dry * theta**1.5 / (1 + 1.9e-5 * ghz**1.5)
    found: np.ndarray = 0.1820 * ghz * (_lines(air, ghz).imag + continuum)
    return found


def decay_rate(air: Air, frequencies: Float[np.ndarray, " freqs"]) -> Float[np.ndarray, " freqs"]:
    """Return by how much a field decays per metre, in nepers. [1/m]."""
    rate: np.ndarray = attenuation_db_km(air, frequencies) / 1000 * (math.log(10) / 20)
    return rate


def line_refractivity(
    air: Air, frequencies: Float[np.ndarray, " freqs"]
) -> Float[np.ndarray, " freqs"]:
    """Return what the lines add to the refractivity at 0 Hz: the dispersion left out. [ppm]."""
    found: np.ndarray = _lines(air, frequencies / 1e9).real
    return found


def _lines(air: Air, ghz: Float[np.ndarray, " freqs"]) -> Complex[np.ndarray, " freqs"]:
    kelvin = air.temperature_c + 273.15
    vapour, theta = vapour_pressure(air), 300 / kelvin
    dry = air.pressure_hpa - vapour
    centre, a1, a2, a3, a4, a5, a6 = OXYGEN.T
    strength = a1 * 1e-7 * dry * theta**3 * np.exp(a2 * (1 - theta))
    width = a3 * 1e-4 * (dry * theta ** (0.8 - a4) + 1.1 * vapour * theta)
    width = np.sqrt(width**2 + 2.25e-6)  # Zeeman splitting
    overlap = (a5 + a6 * theta) * 1e-4 * air.pressure_hpa * theta**0.8
    oxygen = _shapes(ghz, centre, width, overlap) @ strength
    centre, b1, b2, b3, b4, b5, b6 = WATER_VAPOUR.T
    strength = b1 * 1e-1 * vapour * theta**3.5 * np.exp(b2 * (1 - theta))
    width = b3 * 1e-4 * (dry * theta**b4 + b5 * vapour * theta**b6)
    width = 0.535 * width + np.sqrt(0.217 * width**2 + 2.1316e-12 * centre**2 / theta)  # Doppler
    both: np.ndarray = oxygen + _shapes(ghz, centre, width, np.zeros_like(centre)) @ strength
    return both


def _shapes(
    ghz: Float[np.ndarray, " freqs"],
    centre: Float[np.ndarray, " lines"],
    width: Float[np.ndarray, " lines"],
    overlap: Float[np.ndarray, " lines"],
) -> Complex[np.ndarray, "freqs lines"]:
    """Evaluate the complex Van Vleck–Weisskopf shape, whose imaginary part is P.676's."""
    f = ghz[:, None]
    below = (1 - 1j * overlap) / (centre - f - 1j * width)
    above = (1 + 1j * overlap) / (centre + f + 1j * width)
    shape: np.ndarray = f / centre * (below - above)
    return shape
