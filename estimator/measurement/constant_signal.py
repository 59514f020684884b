r"""The signal common to all positions: antenna mismatch, leakage, a converter's offset.

The part of the samples that does not depend on the position, its coherent mean, is no echo of
anything that the aperture could focus; only a plate that faces the whole aperture gives one. With
the singular value decomposition of positions × frequencies, also a leak that drifts is taken out:
its few strongest components (M. Tivive, A. Bouzerdoum, M. Amin, "A subspace projection approach for
wall clutter mitigation in through-the-wall radar imaging", IEEE TGRS 53(4), 2015,
doi:10.1109/TGRS.2014.2355211).
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import scipy.linalg
from jaxtyping import Complex
from scipy.constants import speed_of_light

from estimator.measurement.frequency_resampling import MOST_POINTS, REGULAR
from estimator.measurement.model import Echo, MeasurementError, Uplink

Data = TypeVar("Data", Echo, Uplink)

PROPOSED_DB = 20.0
"""A constant this far above the rest is worth a remark: its side lobes in range (−13 dB for an
untapered sweep) then lie above everything else. [dB]"""

FEWEST_POSITIONS = 5
"""Of fewer the mean is no background: it takes a fifth or more of an echo with it. [-]"""


@dataclass(frozen=True, kw_only=True)
class SharedSignal:
    """How strong what all positions share is, and where it seems to stand."""

    above_rest_db: float  # mean power of the constant over that of the rest
    path: float  # at which its strongest delay lies, in both directions together [m]


def shared_signal(data: Echo | Uplink) -> SharedSignal | None:
    """Measure what all positions share.

    Parameters
    ----------
    data
        A measurement.

    Returns
    -------
    Its level and delay; None for fewer than :data:`FEWEST_POSITIONS` positions, or one frequency.
    """
    samples = data.samples
    if len(samples) < FEWEST_POSITIONS or samples.shape[1] < 2:
        return None
    mean = samples.mean(axis=0)
    constant = float(np.mean(np.abs(mean) ** 2))
    rest = float(np.mean(np.abs(samples - mean) ** 2))
    tiny = float(np.finfo(float).tiny)
    level = 10 * float(np.log10(max(constant, tiny) / max(rest, tiny)))
    step = float(data.frequencies[1] - data.frequencies[0])
    count = 8 * samples.shape[1]
    at = int(np.argmax(np.abs(np.fft.ifft(mean, count))))
    turns = at / count if at < count / 2 else at / count - 1  # what comes early wraps around
    return SharedSignal(above_rest_db=level, path=turns / step * speed_of_light)


def without_shared_signal(data: Data, *, components: int | None = None) -> Data:
    """Subtract what all positions share.

    Parameters
    ----------
    data
        A measurement.
    components
        How many of the strongest principal components are taken out; None: the coherent mean.

    Raises
    ------
    MeasurementError
        If there are too few positions, or as many components as would leave nothing.
    """
    count = min(data.samples.shape)
    if len(data.samples) < FEWEST_POSITIONS:
        raise MeasurementError(
            f"{len(data.samples)} positions share too much with their mean; it is subtracted from "
            f"{FEWEST_POSITIONS} or more"
        )
    if components is None:
        return replace(data, samples=data.samples - data.samples.mean(axis=0))
    if not 1 <= components < count:
        raise MeasurementError(
            f"{components} principal components of {count} would be taken out; take 1 to "
            f"{count - 1}"
        )
    left, sizes, right = np.linalg.svd(data.samples, full_matrices=False)
    sizes = np.where(np.arange(sizes.size) < components, 0.0, sizes)
    return replace(data, samples=(left * sizes) @ right)


def without_delays(data: Data, first: float, last: float) -> Data:
    r"""Take everything at delays of a window out of each position's sweep: a gate.

    The samples' best estimate by echoes of the window alone, all delays equally likely,
    :math:`K (K + \epsilon I)^{-1} s` with :math:`K(f, f') = \operatorname{sinc}[(f - f') T]`, is
    subtracted. Unlike cutting cells of a Fourier transform it also takes the side lobes.

    Parameters
    ----------
    data
        A measurement.
    first, last
        The window of delays, both ways together. [s]

    Raises
    ------
    MeasurementError
        If the window is empty or holds all delays that the frequency step tells apart.
    """
    frequencies = data.frequencies
    if frequencies.size > MOST_POINTS:
        raise MeasurementError(
            f"a gate of {frequencies.size} frequencies; at most {MOST_POINTS}: choose a band"
        )
    length = last - first
    longest = 1 / float(np.diff(frequencies).max())
    if not 0 < length < longest:
        raise MeasurementError(
            f"a gate of {1e9 * first:g} … {1e9 * last:g} ns; it must rise, and be shorter than the "
            f"unambiguous delay of {1e9 * longest:.4g} ns"
        )
    offsets = frequencies - frequencies.mean()
    kernel = np.sinc((offsets[:, None] - offsets) * length)
    factor = scipy.linalg.cho_factor(kernel + REGULAR * np.eye(offsets.size))
    turn = np.exp(2j * np.pi * offsets * (first + last) / 2)
    centred = data.samples * turn
    # s − K (K + εI)⁻¹ s = ε (K + εI)⁻¹ s, without the difference of near equals.
    kept: Complex[np.ndarray, "freqs positions"] = REGULAR * scipy.linalg.cho_solve(
        factor, centred.T
    )
    return replace(data, samples=kept.T * turn.conj())
