r"""Positions that are dead or hot, hot frequencies, clipped samples: found and told.

What a receiver gives where it fails is no echo: next to nothing (a lost trigger, a broken switch),
or noise above the signal (a loose connector, an interferer). Both stand out of their neighbours by
robust statistics, which up to half of the samples do not move:

dead position     its power is less than :data:`DEAD` of the upper quartile of its neighbours'
hot position      the median of its range profile, which a sparse echo leaves at the noise, tells
                  :data:`HOT` times the noise of the others, and most of what it received
clipped sample    its real or imaginary part is the largest of all, to the last digits, as are
                  :data:`RAIL` times as many others as have the next largest value
hot frequency     its power, a median over the positions, is more than :data:`HOT` times that of
                  its neighbours, and its samples disagree with what all others say of them

A position of a line is left out; one of a plane's grid, which must be whole, is set to zero. A
frequency cannot be left out, as grids are uniform: its samples are replaced by the band-limited
continuation of the others [1]_, by turns with the delays at which there is energy and with the
samples that are good. Clipped samples are told and kept: they lie many side by side, and even a
record of signs images.

References
----------
.. [1] A. Papoulis, "A new algorithm in spectral analysis and band-limited extrapolation", IEEE
   Trans. Circuits Syst. 22, 1975, doi:10.1109/TCS.1975.1084118
"""

from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
import scipy.fft
from jaxtyping import Bool, Complex, Float
from scipy.ndimage import percentile_filter

from estimator.array.planar_array import spans_a_plane
from estimator.measurement.model import Echo, Uplink

Data = TypeVar("Data", Echo, Uplink)

FEWEST = 16
"""Positions, and frequencies, of which single ones can stand out. [-]"""
DEAD = 1e-4
"""Power of a dead position over its neighbours': -40 dB. In its place it adds less than a hundredth
of theirs to an image; a shadow's edge falls by 20 dB in some positions. [-]"""
HOT = 20.0
"""Power over its neighbours' median from which noise is a fault: of one exponential variable the
median is exceeded as much once in 10⁶. [-]"""
MOSTLY_NOISE = 0.5
"""Noise of a hot position over its own power: with less, a larger gain raised both. [-]"""
MOST = 0.5
"""Share that may be left out: beyond it a median is no measure of the rest. [-]"""
NEIGHBOURS = 21
"""Positions, and hundredths of the band, that are compared; smooth levels vary less. [-]"""
ROUNDS = 40
"""Alternations of the continuation: gaps of a few frequencies converge in ten. [-]"""
SUPPORT = 10.0
"""Power over the profile's median from which a delay has energy: of an exponential variable, once
in a thousand. [-]"""
RAIL = 8.0
"""Samples of the largest value over those of the next one: alone, one of either; of a converter's
integers, as many or more have the next. [-]"""
SAME = 1e-9
"""Relative difference of values that are one: scaling rounds their last digits. [-]"""
_EXPONENTIAL_MEDIAN = float(np.log(2.0))  # over the mean


@dataclass(frozen=True, kw_only=True)
class Screened(Generic[Data]):
    """Measured data without what failed."""

    data: Data
    notes: tuple[str, ...]


def without_faults(data: Data, name: str) -> Screened[Data]:
    """Leave out the positions and frequencies at which the receiver failed.

    Parameters
    ----------
    data
        Of uniform frequencies, positions in the order of measuring.
    name
        What it is called in notes.

    Returns
    -------
    The data, unchanged if nothing stands out, and what was left out.
    """
    if min(data.samples.shape) < FEWEST:
        return Screened(data=data, notes=())
    notes = []
    samples = data.samples
    rail = _clipped(samples)
    if rail.any():
        notes.append(
            f"the {name} is clipped: {100 * rail.mean():.2g} % of its samples have one and the "
            "same largest real or imaginary part; receive with less gain"
        )
    hot = _hot_frequencies(samples)
    if hot.any():
        samples = _continued(samples, hot)
        notes.append(
            f"the {name} is noise at {_count(hot, 'frequency', 'frequencies')} of {hot.size} "
            f"({_some(data.frequencies[hot] / 1e9)} GHz), more than "
            f"{10 * np.log10(HOT):.0f} dB above the others: it was replaced there by what the "
            "others say; look for an interferer"
        )
    dead, noisy = _dead_positions(samples), _noisy_positions(samples)
    bad = dead | noisy
    if bad.any() and bad.mean() <= MOST:
        for which, what in ((dead, "next to nothing"), (noisy & ~dead, "noise above its signal")):
            if which.any():
                notes.append(
                    f"the {name} holds {what} at {_count(which, 'position', 'positions')} of "
                    f"{which.size} (number {_some(np.flatnonzero(which) + 1.0)}): "
                    f"{'it was' if which.sum() == 1 else 'they were'} left out; look for a lost "
                    "trigger or a loose connector"
                )
        if not spans_a_plane(data.positions):
            kept = _at(data, samples, ~bad)
            return Screened(data=kept, notes=tuple(notes))
        samples = np.where(bad[:, None], 0.0, samples)
    if not notes:
        return Screened(data=data, notes=())
    return Screened(data=replace(data, samples=samples), notes=tuple(notes))


def _at(
    data: Data, samples: Complex[np.ndarray, "positions freqs"], which: Bool[np.ndarray, " any"]
) -> Data:
    """Return samples at some of the positions."""
    if isinstance(data, Uplink) or data.transmit_positions is None:
        return replace(data, samples=samples[which], positions=data.positions[which])
    return replace(
        data,
        samples=samples[which],
        positions=data.positions[which],
        transmit_positions=data.transmit_positions[which],
    )


def _count(which: Bool[np.ndarray, " any"], one: str, many: str) -> str:
    count = int(np.count_nonzero(which))
    return f"{count} {one if count == 1 else many}"


def _some(values: Float[np.ndarray, " any"]) -> str:
    text = ", ".join(f"{value:.6g}" for value in values[:3])
    return text if values.size <= 3 else f"{text}, …"


def _clipped(
    samples: Complex[np.ndarray, "positions freqs"],
) -> Bool[np.ndarray, "positions freqs"]:
    parts = np.maximum(np.abs(samples.real), np.abs(samples.imag))
    top = float(parts.max())
    rail = parts >= top * (1 - SAME)
    both = np.abs(np.concatenate([samples.real.ravel(), samples.imag.ravel()]))
    at_top = both >= top * (1 - SAME)
    below = both[~at_top]
    following = np.count_nonzero(below >= below.max() * (1 - SAME)) if below.size else both.size
    return np.asarray(rail & bool(np.count_nonzero(at_top) > RAIL * following))


def _hot_frequencies(samples: Complex[np.ndarray, "positions freqs"]) -> Bool[np.ndarray, " freqs"]:
    power = np.abs(samples) ** 2
    level = np.median(power, axis=1, keepdims=True)
    level = np.where(level > 0, level, max(float(level.max()), np.finfo(float).tiny))
    typical = np.median(power / level, axis=0)
    size = max(5, 2 * (typical.size * NEIGHBOURS // 200) + 1)
    around = percentile_filter(typical, 50, size=size, mode="reflect")
    hot = typical > HOT * around
    if not hot.any() or hot.mean() > MOST:
        return np.zeros_like(hot)
    expected = _continued(samples, hot)
    off = np.median(np.abs(samples - expected)[:, hot] ** 2 / level, axis=0)
    hot[hot] = off > HOT * around[hot]
    return np.asarray(hot)


def _dead_positions(
    samples: Complex[np.ndarray, "positions freqs"],
) -> Bool[np.ndarray, " positions"]:
    power = np.mean(np.abs(samples) ** 2, axis=1)
    around = percentile_filter(power, 75, size=NEIGHBOURS, mode="reflect")
    return np.asarray(power < DEAD * around)


def _noisy_positions(
    samples: Complex[np.ndarray, "positions freqs"],
) -> Bool[np.ndarray, " positions"]:
    window = np.hanning(samples.shape[1] + 2)[1:-1]
    profiles = np.abs(scipy.fft.ifft(samples * window, axis=1, norm="forward")) ** 2
    noise = np.median(profiles, axis=1) / _EXPONENTIAL_MEDIAN / float((window**2).sum())
    power = np.mean(np.abs(samples) ** 2, axis=1)
    return np.asarray((noise > HOT * np.median(noise)) & (noise > MOSTLY_NOISE * power))


def _continued(
    samples: Complex[np.ndarray, "positions freqs"], missing: Bool[np.ndarray, " freqs"]
) -> Complex[np.ndarray, "positions freqs"]:
    """Replace samples at some frequencies by the continuation of the others."""
    filled = np.where(missing, 0.0, samples)
    for _ in range(ROUNDS):
        profiles = scipy.fft.ifft(filled, axis=1)
        power = np.mean(np.abs(profiles) ** 2, axis=0)
        profiles[:, power < SUPPORT * np.median(power)] = 0.0
        filled = np.where(missing, scipy.fft.fft(profiles, axis=1), samples)
    return np.asarray(filled)
