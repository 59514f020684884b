"""How few frequencies carry a band: waves whose delays lie close together vary slowly over it.

Once a common delay is taken out of contributions that lie within an interval of delays, they
are interpolated from a few Chebyshev nodes; where that takes as many frequencies as there are,
every frequency is worked out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from scipy.special import jv

from simulator.facet_reflection import reflection_nodes
from simulator.frequency_sum import ACCURACY, FrequencySum, chebyshev_nodes
from simulator.materials import Material


@dataclass(frozen=True)
class EveryFrequency:
    """Sums contributions whose amplitudes are known at every frequency."""

    frequencies: Float[np.ndarray, " freqs"]

    @property
    def nodes(self) -> Float[np.ndarray, " nodes"]:
        """Where the amplitudes are known: everywhere."""
        return self.frequencies

    def __call__(
        self,
        delays: Float[np.ndarray, " sources"],
        amplitudes: Complex[np.ndarray, "freqs sources"],
    ) -> Complex[np.ndarray, " freqs"]:
        """Sum ``amplitudes`` delayed by ``delays``."""
        turns = self.frequencies[:, None] * delays
        phasors = np.exp(-2j * np.pi * (turns - np.rint(turns)))
        return np.asarray(np.einsum("fs,fs->f", amplitudes, phasors))


def few_frequencies(
    frequencies: Float[np.ndarray, " freqs"],
    spread: float,
    materials: Sequence[Material],
    pattern_nodes: int,
    interpolate: bool,
) -> FrequencySum | EveryFrequency:
    """Choose at how few frequencies waves have to be known to be summed over the band.

    Parameters
    ----------
    frequencies
        Uniform grid. [Hz]
    spread
        By how much the lengths of paths differ that arrive at one facet. [m]
    materials
        What reflects them.
    pattern_nodes
        Frequencies that the patterns of the two antennas have to be known at, in all.
    interpolate
        Whether few frequencies are wanted.

    Returns
    -------
    The sum over the band of contributions known at its ``nodes``: all frequencies, if it
    takes no fewer.
    """
    start, stop = float(frequencies[0]), float(frequencies[-1])
    count = nodes_for_delays(spread / speed_of_light, stop - start) + pattern_nodes - 2
    # Degrees of a product add up: one coefficient for each surface of the chain.
    count += sum(reflection_nodes(material, start, stop) - 1 for material in materials)
    if interpolate and count < frequencies.size:
        return FrequencySum(frequencies, chebyshev_nodes(start, stop, count))
    return EveryFrequency(frequencies)


def nodes_for_delays(delay_spread: float, bandwidth: float) -> int:
    r"""Count the Chebyshev nodes that interpolate delays within an interval over a band.

    The error of interpolating :math:`e^{j\delta u}`, :math:`|u| \le 1`, at M nodes is at most
    twice the sum of the Chebyshev coefficients left out, :math:`4 \sum_{m \ge M} |J_m(\delta)|`.

    Parameters
    ----------
    delay_spread
        Width of the interval. [s]
    bandwidth
        Width of the band. [Hz]

    Returns
    -------
    The fewest whose error is below :data:`simulator.frequency_sum.ACCURACY`.
    """
    half_phase = np.pi * delay_spread * bandwidth / 2
    orders = np.arange(1, 40 + int(2 * half_phase))
    left_out = 4 * np.cumsum(np.abs(jv(orders, half_phase))[::-1])[::-1]
    return int(orders[np.argmax(left_out <= ACCURACY)])
