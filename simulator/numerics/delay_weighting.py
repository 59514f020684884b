r"""Weights over delay, given to signals whose paths are summed already.

Samples :math:`s(f) = \sum_p a_p e^{-j 2 \pi f \tau_p}` of neighbouring frequencies, added with
weights :math:`c_m`, are :math:`\sum_p a_p g(\tau_p) e^{-j 2 \pi f \tau_p}` with
:math:`g(\tau) = \sum_m c_m e^{-j 2 \pi m \delta \tau}`. With the weights of
:math:`g(\tau) = e^{-d \tau}` each path decays as its own length says, whichever kernel summed it:
facets, chains of mirrors and edges alike. The neighbours must tell apart all delays up to the
longest, so the grid is refined where its own step does not. An amplitude that itself varies with
frequency counts as a length, that of Friis (λ) as λ/2π: some 1e-6 of a field over the 325 GHz line.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

NEIGHBOURS = 8
"""Samples used on either side: with :data:`SHARE` the decay of each path is right to 4e-7 of
the largest. [-]"""

SHARE = 0.5
"""Largest share of the unambiguous delays that paths fill: the weight jumps where they wrap. [-]"""

DELAYS = 400
"""Delays at which the weights are fitted: many more than the unknowns. [-]"""


@dataclass(frozen=True, kw_only=True)
class NeighbourGrid:
    """A uniform frequency grid, refined, and longer by some samples on either side."""

    start: float  # [Hz]
    stop: float  # [Hz]
    points: int
    refined: int  # its steps in one of the original's
    longest: float  # delay up to which weights hold [s]

    @property
    def step(self) -> float:
        """Of the refined grid [Hz]."""
        return (self.stop - self.start) / (self.points - 1)


def neighbour_grid(frequencies: Float[np.ndarray, " freqs"], longest: float) -> NeighbourGrid:
    """Return the grid whose samples :func:`decayed` needs.

    Parameters
    ----------
    frequencies
        Uniform, at least two. [Hz]
    longest
        The longest delay of any path. [s]
    """
    step = float(frequencies[-1] - frequencies[0]) / (frequencies.size - 1)
    refined = max(1, math.ceil(longest * step / SHARE))
    fine = step / refined
    return NeighbourGrid(
        start=float(frequencies[0]) - NEIGHBOURS * fine,
        stop=float(frequencies[-1]) + NEIGHBOURS * fine,
        points=(frequencies.size - 1) * refined + 1 + 2 * NEIGHBOURS,
        refined=refined,
        longest=longest,
    )


def decayed(
    samples: Complex[np.ndarray, "channels fine"],
    grid: NeighbourGrid,
    rates: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, "channels freqs"]:
    """Let each path decay over its own delay, and return the samples of the original grid.

    Parameters
    ----------
    samples
        On the frequencies of ``grid``.
    grid
        From :func:`neighbour_grid`.
    rates
        The field's decay d at each frequency of the original grid. [1/s]
    """
    delays = np.linspace(0.0, grid.longest, DELAYS)
    order = np.arange(-NEIGHBOURS, NEIGHBOURS + 1)
    shifts = np.exp(-2j * np.pi * grid.step * np.outer(delays, order))
    # What is fitted is the departure from 1, which is small: its relative error counts.
    wanted = np.expm1(-np.outer(delays, rates))
    weights = np.linalg.lstsq(shifts, wanted.astype(np.complex128), rcond=1e-9)[0]
    weights[NEIGHBOURS] += 1.0
    total = np.zeros((len(samples), rates.size), dtype=np.complex128)
    for weight, offset in zip(weights, order + NEIGHBOURS, strict=True):
        last = offset + (rates.size - 1) * grid.refined + 1
        total += weight * samples[:, offset : last : grid.refined]
    return total
