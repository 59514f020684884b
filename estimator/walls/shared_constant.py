r"""The echo common to all positions: a plate parallel to the array, or an instrument's constant.

A mirror that faces the array returns the same to each position, :math:`\lambda / (8 \pi d)\,
e^{-2jkd}`; so do a mismatch of the antenna, leakage between antennas, and a receiver's offset.
Tilt, edges and roughness would identify a plate. Where the echo shows none of these, two
indications remain: a plate has one delay over the whole band, and multiple reflections at
multiples of it. They are no proof.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.imaging.peak_detection import vertex_shift
from estimator.imaging.range_compression import unambiguous_path
from estimator.measurement.constant_signal import PROPOSED_DB
from estimator.measurement.model import Echo

FEWEST = 8
"""Positions of which a mean tells anything: independent echoes of fewer share an eighth of their
energy and more by chance. With 4 and 16 the targets of 30 scans are the same (``python -m
validation.experiments.thresholds images``). [-]"""
ONE_DELAY = 0.95
"""Share of the constant's energy that one delay explains, from which it may be a plate: mismatch
and offsets vary over the band. [-]"""
LEAST_BEND = 1.0
"""Phase at the array's end by which the wave of a point at the same distance bends: where it is
less, a far point is a constant as well, and nothing is taken out. [rad]"""
CONFIDENCE = 0.9
"""Confidence of a mirror of which only this is known: below what is reported as certain. [-]"""
OVERSAMPLED = 8
"""Delays tried for each range cell: the summit of a parabola between them is good to a thousandth.
[-]"""
MULTIPLE_LEVEL = 3.0
"""Magnitude over the profile's median from which a multiple is counted: of Rayleigh noise one delay
in 500 has it. It is only told, and decides nothing. [-]"""
LEAST_VARYING = 1e-30
"""Least energy that the positions do not share, over what they do, that is divided by. [-]"""
MULTIPLE = 1.5
"""Distance from a multiple of the plate's within which a delay is one. [cells c/2B]"""


@dataclass(frozen=True, kw_only=True)
class SharedConstant:
    """What the positions share."""

    echo: Echo  # without it; as it was if nothing was taken out
    level_db: float | None = None  # of the constant over the rest; None: nothing was taken out
    distance: float | None = None  # of the plate that it may be [m]
    deviation: float = 0.0  # of that distance [m]
    tilt_deviation: float = 0.0  # of the plate's normal from the array's [rad]
    notes: tuple[str, ...] = ()


def without_constant(echo: Echo) -> SharedConstant:
    """Take out what all positions share, where it hides the rest.

    Parameters
    ----------
    echo
        In the array's frame.
    """
    constant = echo.samples.mean(axis=0)
    rest = echo.samples - constant
    shared = float(np.vdot(constant, constant).real) * len(rest)
    varying = max(float(np.vdot(rest, rest).real), LEAST_VARYING * shared)
    if len(rest) < FEWEST or shared < 10 ** (PROPOSED_DB / 10) * varying:
        return SharedConstant(echo=echo)
    distance, explained, deviation = _one_delay(constant, echo.frequencies)
    half = 0.5 * float(np.linalg.norm(np.ptp(echo.positions, axis=0)))
    wavenumber = 2 * np.pi * float(echo.frequencies.mean()) / speed_of_light
    period = unambiguous_path(echo.frequencies) / 2
    # A delay before the reference plane appears at the end of the period.
    away = min(distance, period - distance)
    if wavenumber * half**2 / max(away, 1e-9) < LEAST_BEND:
        return SharedConstant(echo=echo)
    level = 10 * np.log10(shared / varying)
    told = (
        f"all positions share one constant, {level:.0f} dB above the rest; it was taken out, and "
        "what follows is found in the rest"
    )
    nearest = speed_of_light / float(echo.frequencies[-1])
    plate = explained >= ONE_DELAY and nearest < distance < unambiguous_path(echo.frequencies) / 4
    cell = speed_of_light / (2 * float(np.ptp(echo.frequencies)))
    plate = plate and distance > cell
    if not plate:
        return SharedConstant(
            echo=replace(echo, samples=rest),
            level_db=float(level),
            notes=(f"{told}: it has no single delay of a plate (mismatch, leakage or an offset)",),
        )
    multiples = _multiples(constant, echo.frequencies, distance, cell)
    repeated = f", and repeats {multiples} times between plate and antenna" if multiples else ""
    return SharedConstant(
        echo=replace(echo, samples=rest),
        level_db=float(level),
        distance=distance,
        deviation=deviation,
        tilt_deviation=float(np.sqrt(varying / shared)) / (2 * wavenumber * half),
        notes=(
            f"{told}: it has the delay of a plate {distance:.4g} m ahead, parallel to the array"
            f"{repeated}; a constant of the instrument would look the same, and users are not "
            "placed over it",
        ),
    )


def _one_delay(
    constant: Complex[np.ndarray, " freqs"], frequencies: Float[np.ndarray, " freqs"]
) -> tuple[float, float, float]:
    """Fit one delay: its distance [m], the share of energy it explains, its deviation [m]."""
    best = (0.0, -1.0)
    for falls in (0, 1):  # a plate's amplitude falls as λ, behind an antenna's gain it may be even
        spectrum = constant * (frequencies / frequencies.mean()) ** falls
        profile = _profile(spectrum, frequencies)
        energy = float(np.vdot(spectrum, spectrum).real) * frequencies.size
        top = int(np.argmax(np.abs(profile)))
        share = float(np.abs(profile[top]) ** 2) / energy
        if share > best[1]:
            period = unambiguous_path(frequencies) / 2
            best = (_summit(np.abs(profile), top) * period / profile.size, share)
    distance, share = best
    spread = float(np.std(frequencies))
    snr = share / max(1 - share, 1e-12) * frequencies.size
    deviation = speed_of_light / (4 * np.pi * spread * np.sqrt(2 * snr))
    return distance, share, float(deviation)


def _profile(
    spectrum: Complex[np.ndarray, " freqs"], frequencies: Float[np.ndarray, " freqs"]
) -> Complex[np.ndarray, " cells"]:
    step = speed_of_light / unambiguous_path(frequencies)
    places = np.rint((frequencies - frequencies[0]) / step).astype(np.int64)
    size = int(scipy.fft.next_fast_len(OVERSAMPLED * (int(places[-1]) + 1)))
    padded = np.zeros(size, dtype=np.complex128)
    padded[places] = spectrum
    return np.asarray(scipy.fft.ifft(padded, norm="forward"))


def _summit(magnitude: Float[np.ndarray, " cells"], top: int) -> float:
    before, at, after = (magnitude[(top + i) % magnitude.size] for i in (-1, 0, 1))
    return top + float(vertex_shift(before, at, after))


def _multiples(
    constant: Complex[np.ndarray, " freqs"],
    frequencies: Float[np.ndarray, " freqs"],
    distance: float,
    cell: float,
) -> int:
    """Count the distances 2d, 3d, … at which the constant has a maximum above its background."""
    window = np.hanning(frequencies.size + 2)[1:-1]
    magnitude = np.abs(_profile(constant * window, frequencies))
    period = unambiguous_path(frequencies) / 2
    step = period / magnitude.size
    floor = MULTIPLE_LEVEL * float(np.median(magnitude))
    reach = max(1, int(MULTIPLE * cell / step))
    count = 0
    for order in range(2, int(period / distance)):
        middle = int(order * distance / step)
        around = magnitude[max(middle - 2 * reach, 0) : middle + 2 * reach + 1]
        top = int(np.argmax(around))
        if around.size < 3 or around[top] < floor or not 0 < top < around.size - 1:
            break
        if abs(top - min(middle, 2 * reach)) > reach:
            break
        count += 1
    return count
