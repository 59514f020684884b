"""Range gating: echoes or paths near one length, at as many frequencies as these need."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, Uplink, frequency_step

Measured = TypeVar("Measured", Echo, Uplink)

HANN_REACH = 12.0
"""Decimated period over the reach on either side: a Hann block loses 1 dB at a twelfth of it. [-]
"""
FEWEST_BLOCKS = 8
"""Frequencies that are left at least; of fewer there is nothing to decimate. [-]"""


def gated(measured: Measured, path_length: float, *, reach: float) -> Measured:
    """Keep what arrives near one length, and only as many frequencies as that needs.

    Blocks of neighbouring frequencies are averaged with Hann weights after the phase of
    ``path_length`` was removed; it is restored afterwards. What is farther than ``reach`` away is
    attenuated, and what is near keeps its phase.

    Parameters
    ----------
    measured
        Echo or uplink on a uniform grid of frequencies.
    path_length
        Distance of an echo, length of an uplink's path. [m]
    reach
        Lengths to either side that must stay. [m]
    """
    passes = 2 if isinstance(measured, Echo) else 1
    unambiguous = speed_of_light / (passes * frequency_step(measured.frequencies))
    hop = int(unambiguous / (HANN_REACH * reach))
    blocks = (measured.frequencies.size - 1) // max(hop, 1) - 1
    if hop < 2 or blocks < FEWEST_BLOCKS:
        return measured
    window = np.sin(np.pi * np.arange(1, 2 * hop) / (2 * hop)) ** 2
    window = window / window.sum()
    index = hop * np.arange(blocks)[:, None] + np.arange(2 * hop - 1)
    turn = np.exp(2j * np.pi * passes * measured.frequencies * path_length / speed_of_light)
    centres = measured.frequencies[index[:, hop - 1]]
    flat = measured.samples * turn
    back = np.conj(turn[index[:, hop - 1]])
    samples = np.einsum("mbw,w->mb", flat[:, index], window) * back
    return replace(measured, samples=samples, frequencies=centres)
