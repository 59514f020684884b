"""Measurements of simple receivers on a pilot: strength, time and angle of arrival."""

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from scipy.optimize import minimize_scalar

from estimator.measurement.model import Uplink

FIRST_PATH_DB = -12.0
"""Least level of the first path relative to the strongest one; sidelobes of Hann's window are below
-31 dB. [dB]"""
DETECTION_DB = 13.0
"""Least peak of a detected path over the median of the profile: noise alone exceeds it in one of
some thousand cells. [dB]"""
OVERSAMPLING = 8
"""Samples of length for each cell c/B: the search begins within a sixteenth of a cell of a peak.
[-]"""
MOST_PATHS = 6
"""Most paths of the search over a band with gaps: the direct one, the wall's, and those of the
wall's two ends are four, and two are left for what the fit of these leaves. [-]"""
LENGTH_TOLERANCE = 1e-7
"""Tolerance of a path's length: far below a wavelength of 1 mm. [m]"""
ANGLE_OVERSAMPLING = 8
"""Samples of the cosine for each antenna: at half a wavelength, seven for each −3 dB beam, so that
the search begins on the main lobe. [-]"""
FEWEST_COSINES = 64
"""Least number of samples of the cosine, for arrays of fewer than eight antennas: 1/32 apart, so
that the search begins on the main lobe, λ/D to either side, of arrays D of up to 32 wavelengths.
[-]"""
COSINE_TOLERANCE = 1e-8
"""Tolerance of a cosine: the square root of float64's rounding, below which a maximum is flat.
[-]"""


def strength_db(pilot: Uplink) -> float:
    """Return the received signal strength: mean power over antennas and band [dB]."""
    return float(10 * np.log10(np.mean(np.abs(pilot.samples) ** 2)))


def first_arrival(
    samples: Complex[np.ndarray, " freqs"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    longest: float | None = None,
) -> float | None:
    """Return the length of the earliest path within :data:`FIRST_PATH_DB` of the strongest [m].

    Parameters
    ----------
    samples, frequencies
        Of one antenna, on any grid. [-], [Hz]
    longest
        Longest path; ``None``: the unambiguous one of the smallest step. [m]

    Returns
    -------
    ``None`` if no path is detected.
    """
    reach = longest or float(speed_of_light / np.diff(frequencies).min())
    cell = float(speed_of_light / np.ptp(frequencies))
    lengths = np.arange(0.0, reach, cell / OVERSAMPLING)
    tapered = samples * np.hanning(len(samples) + 2)[1:-1]
    middle = float(frequencies.mean())

    def level(length: Float[np.ndarray, " lengths"]) -> Float[np.ndarray, " lengths"]:
        turns = np.outer(length, (frequencies - middle) / speed_of_light)
        return np.asarray(np.abs(np.exp(2j * np.pi * turns) @ tapered))

    profile = level(lengths)
    if profile.max() < 10 ** (DETECTION_DB / 20) * np.median(profile):
        return None
    least = 10 ** (FIRST_PATH_DB / 20) * profile.max()
    peaks = np.flatnonzero(
        (profile[1:-1] >= profile[:-2]) & (profile[1:-1] > profile[2:]) & (profile[1:-1] >= least)
    )
    if not peaks.size:
        return None
    coarse = float(lengths[peaks[0] + 1])
    best = minimize_scalar(
        lambda length: -float(level(np.array([length]))[0]),
        bounds=(coarse - cell / OVERSAMPLING, coarse + cell / OVERSAMPLING),
        method="bounded",
        options={"xatol": LENGTH_TOLERANCE},
    )
    return float(best.x)


def first_sparse_arrival(
    samples: Complex[np.ndarray, " freqs"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    most: int = MOST_PATHS,
) -> float | None:
    """Return the same for a band with gaps, with the profile as a sum of a few paths [m].

    Orthogonal matching pursuit: the strongest path of the residual, refined off the grid, is added,
    and all amplitudes are fitted again.

    Parameters
    ----------
    samples, frequencies
        See :func:`first_arrival`.
    most
        Most paths.
    """
    cell = float(speed_of_light / np.ptp(frequencies))
    lengths = np.arange(0.0, speed_of_light / np.diff(frequencies).min(), cell / OVERSAMPLING)
    turns = 2j * np.pi * (frequencies - frequencies.mean()) / speed_of_light
    grid = np.exp(np.outer(lengths, turns))
    found: list[float] = []
    left, gains = samples, np.zeros(0, dtype=np.complex128)
    while len(found) < most:
        profile = np.abs(grid @ left)
        if profile.max() < 10 ** (DETECTION_DB / 20) * np.median(profile):
            break
        for length in found:
            profile[np.abs(lengths - length) < cell] = 0.0
        start, rest = float(lengths[int(np.argmax(profile))]), left
        best = minimize_scalar(
            lambda length, rest=rest: -float(np.abs(np.exp(turns * length) @ rest)),
            bounds=(start - cell / OVERSAMPLING, start + cell / OVERSAMPLING),
            method="bounded",
            options={"xatol": LENGTH_TOLERANCE},
        )
        found.append(float(best.x))
        waves = np.exp(-np.outer(turns, found))
        gains = np.linalg.lstsq(waves, samples, rcond=None)[0]
        left = samples - waves @ gains
    if not found:
        return None
    levels = np.abs(gains)
    strong = levels >= 10 ** (FIRST_PATH_DB / 20) * levels.max()
    return float(np.array(found)[strong].min())


def plane_wave_angle(pilot: Uplink) -> float:
    """Return the angle of the strongest plane wave from the array's axis, band averaged [rad].

    The maximum of Bartlett's spectrum, refined off the grid; the array's axis is from its first
    element to its last.
    """
    axis = pilot.positions[-1] - pilot.positions[0]
    places = (pilot.positions - pilot.positions.mean(axis=0)) @ axis / np.linalg.norm(axis)
    wavenumbers = 2 * np.pi * pilot.frequencies / speed_of_light

    def power(cosine: float) -> float:
        steering = np.exp(-1j * cosine * np.outer(places, wavenumbers))
        return float((np.abs((steering * pilot.samples).sum(axis=0)) ** 2).sum())

    count = max(ANGLE_OVERSAMPLING * len(places), FEWEST_COSINES)
    cosines = np.linspace(-1.0, 1.0, count + 1)
    best = float(cosines[int(np.argmax([power(float(cosine)) for cosine in cosines]))])
    step = 2.0 / count
    found = minimize_scalar(
        lambda cosine: -power(float(cosine)),
        bounds=(max(best - step, -1.0), min(best + step, 1.0)),
        method="bounded",
        options={"xatol": COSINE_TOLERANCE},
    )
    return float(np.arccos(found.x))
