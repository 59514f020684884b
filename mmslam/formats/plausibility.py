"""Checks that a measurement's magnitudes are physically possible: wrong units are refused."""

import numpy as np
from jaxtyping import Complex, Float, Num
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree

from estimator.measurement.model import MeasurementError

LOWEST, HIGHEST = 1e7, 1e13
"""Frequencies of radios that make images: antennas of ground-penetrating radar begin at 10 MHz; 220
in GHz, taken for Hz, lies far below; 220e9 in Hz, taken for GHz, far above. [Hz]"""

UNUSUAL = 1e9
"""Below this the frequencies are remarked: of ground-penetrating radar, or in a wrong unit. [Hz]"""

WIDEST = 20.0
"""Largest aperture: 130 mm taken for metres lie far above. [m]"""

SPARSEST = 20.0
"""Largest median distance of neighbours, in wavelengths: 0.5 mm taken for metres is 400."""

STRONGEST = 1.0
"""Largest magnitude that a passive link can have, an S-parameter. [-]"""


LARGEST_SAMPLE = 2.0**32
"""Largest magnitude that is read: counts of a 32-bit converter; more is a damaged number. [-]"""

FARTHEST = 1000.0
"""Largest coordinate; beyond, phases at 1 THz lose 1e-6 rad in double precision. [m]"""


def check_samples(name: str, samples: Num[np.ndarray, "positions points"]) -> None:
    """Refuse samples of an impossible magnitude.

    Raises
    ------
    MeasurementError
        If a magnitude is above :data:`LARGEST_SAMPLE`; NaN is ignored.
    """
    parts = (np.abs(samples.real), np.abs(samples.imag))
    largest = max(float(np.fmax.reduce(part, axis=None)) for part in parts)  # without NaN
    if largest > LARGEST_SAMPLE:
        raise MeasurementError(
            f"{name}: samples reach {largest:.3g}; counts of a converter are at most "
            f"{LARGEST_SAMPLE:.3g}: the file may be damaged, or the mapping names another variable"
        )


def check_frequencies(
    name: str, frequencies: Float[np.ndarray, " freqs"], remedy: str
) -> str | None:
    """Refuse frequencies outside the range of imaging radars; remark unusual ones.

    Raises
    ------
    MeasurementError
        If one is outside :data:`LOWEST` … :data:`HIGHEST`.
    """
    low, high = float(frequencies.min()), float(frequencies.max())
    if not LOWEST <= low <= high <= HIGHEST:
        raise MeasurementError(
            f"{name}: frequencies {low:.6g} … {high:.6g} Hz; they must be {LOWEST:.0e} … "
            f"{HIGHEST:.0e} Hz: {remedy}"
        )
    if low < UNUSUAL:
        return f"{name}: frequencies from {low:.6g} Hz, below 1 GHz; if that is unusual, {remedy}"
    return None


def check_positions(
    name: str,
    positions: Float[np.ndarray, "positions 3"],
    shortest_wave: float,
    *,
    any_size: bool,
    remedy: str,
    counted: bool = False,
) -> str | None:
    """Refuse an array larger, sparser or smaller than any that could be imaged with.

    Parameters
    ----------
    name
        What the positions belong to, for the message.
    positions
        Where the antenna stood. [m]
    shortest_wave
        Shortest wavelength. [m]
    any_size
        Accept any extent and spacing.
    remedy
        Which key to change, for the message.
    counted
        The coordinates rise by one, as indices do: a small extent is remarked, not refused.

    Returns
    -------
    A remark, if the array is too small and its coordinates look like indices.

    Raises
    ------
    MeasurementError
        If a coordinate is above :data:`FARTHEST`, the extent above :data:`WIDEST` or below a
        wavelength, or neighbours are further apart than :data:`SPARSEST` wavelengths.
    """
    farthest = float(np.abs(positions).max())
    if farthest > FARTHEST:
        raise MeasurementError(
            f"{name}: a coordinate of {farthest:.4g} m; it must be at most {FARTHEST:g} m: set the "
            "unit and the origin of [positions] right"
        )
    if len(positions) < 2 or any_size:
        return None
    extent = float(np.ptp(positions, axis=0).max())
    # The first neighbour of a point is the point itself.
    distances = np.asarray(cKDTree(positions).query(positions, k=2)[0])
    apart = float(np.median(distances[:, 1]))
    if extent > WIDEST:
        reason = f"an array of {extent:.4g} m; it must be at most {WIDEST:g} m"
    elif extent < shortest_wave:
        reason = (
            f"an array of {1e3 * extent:.4g} mm is smaller than the wavelength "
            f"({1e3 * shortest_wave:.4g} mm) and tells no angle"
        )
    elif apart > SPARSEST * shortest_wave:
        reason = (
            f"positions {1e3 * apart:.4g} mm apart, {apart / shortest_wave:.0f} wavelengths; "
            f"they must be at most {SPARSEST:g} wavelengths apart"
        )
    else:
        return None
    if counted and extent < shortest_wave:
        return (
            f"{name}: {reason}; the numbers in the file names rise by one: if they count steps, "
            "give first and step in [positions]"
        )
    raise MeasurementError(f"{name}: {reason}: {remedy}")


def strength_note(name: str, samples: Complex[np.ndarray, "positions freqs"]) -> str | None:
    """Remark that samples are stronger than a passive link's."""
    strongest = float(np.abs(samples).max())
    if strongest <= STRONGEST:
        return None
    return (
        f"{name}: samples reach |S| = {strongest:.4g}; a passive link stays below 1: are they in "
        "decibels, amplified, or counts of a converter (scale brings them to S-parameters)?"
    )


def sign_note(
    name: str,
    samples: Complex[np.ndarray, "positions freqs"],
    frequencies: Float[np.ndarray, " freqs"],
) -> str | None:
    r"""Remark that the delays look negative: the other time convention may be meant.

    On a grid of step Δf, delays are known modulo 1/Δf; negative ones appear in the upper half of
    this interval. Echoes of a room are in the lower half if its paths are shorter than c/2Δf.
    """
    power = (np.abs(np.fft.ifft(samples, axis=1)) ** 2).sum(axis=0)
    half = len(power) // 2
    # The first and the middle cells belong to neither half: a leak of the antennas is there.
    early, late = power[1:half].sum(), power[half + 1 :].sum()
    if len(power) < 8 or late <= 2 * early:  # twice: noise alone fills both alike
        return None
    reach = speed_of_light / float(frequencies[1] - frequencies[0])
    return (
        f"{name}: most of the power comes after half of the unambiguous path of {reach:.4g} m; "
        "if the path is shorter than that half, set time_convention to the other sign"
    )
