"""Sums of delayed contributions on a uniform frequency grid, by non-uniform FFT.

A contribution of delay τ and amplitude a(f) adds a(f)·exp(−j2πfτ). Amplitudes that vary
slowly over the band (phase slope of a facet, Fresnel coefficient, pattern) are sampled at
a few Chebyshev nodes and interpolated between them, so that the sum separates into a few
type-1 transforms and its cost does not depend on the number of frequencies.
"""

import math
import threading
from dataclasses import dataclass, field

import finufft
import numpy as np
from jaxtyping import Complex, Float

ACCURACY = 1e-6
"""Required relative error of the transform and of the interpolation over frequency. [-]"""


def chebyshev_nodes(start: float, stop: float, count: int) -> Float[np.ndarray, " nodes"]:
    """Return Chebyshev nodes of the first kind on an interval, rising."""
    angles = np.pi * (2 * np.arange(count)[::-1] + 1) / (2 * count)
    return 0.5 * (start + stop) + 0.5 * (stop - start) * np.cos(angles)


def lagrange_basis(
    nodes: Float[np.ndarray, " nodes"], points: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "nodes points"]:
    """Evaluate each node's Lagrange polynomial at the points."""
    basis = np.ones((nodes.size, points.size))
    for this, node in enumerate(nodes):
        for other in np.delete(nodes, this):
            basis[this] *= (points - other) / (node - other)
    return basis


def barycentric_basis(
    nodes: Float[np.ndarray, " nodes"], points: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "nodes points"]:
    """Interpolate from Chebyshev nodes of the first kind to any points: each node's polynomial."""
    weights = (-1.0) ** np.arange(nodes.size)
    weights *= np.sin(np.pi * (2 * np.arange(nodes.size) + 1) / (2 * nodes.size))
    apart = points - nodes[:, None]
    meet = apart == 0.0
    rows = weights[:, None] / np.where(meet, 1.0, apart)
    rows = np.where(meet.any(axis=0), meet, rows)
    basis: np.ndarray = rows / rows.sum(axis=0)
    return basis


def nodes_needed(delay_spread: float, bandwidth: float, *, accuracy: float = ACCURACY) -> int:
    r"""Count the nodes that interpolate :math:`\operatorname{sinc}(\pi f \Delta\tau)` over a band.

    The interpolation error of :math:`e^{j\delta u}`, :math:`|u| \le 1`, at M Chebyshev nodes is
    at most :math:`2 (\delta/2)^M / M!`, here with :math:`\delta = \pi \Delta\tau B / 2`.

    Parameters
    ----------
    delay_spread
        Largest difference of delay over one contribution, :math:`\Delta\tau`. [s]
    bandwidth
        Width of the band, B. [Hz]
    accuracy
        Largest error. [-]

    Returns
    -------
    The smallest M whose bound is below it.
    """
    half_phase = math.pi * delay_spread * bandwidth / 2
    count = 1
    while 2 * (half_phase / 2) ** count / math.factorial(count) > accuracy:
        count += 1
    return count


@dataclass(frozen=True)
class FrequencySum:
    """Sums contributions on one frequency grid; safe to call from several threads."""

    frequencies: Float[np.ndarray, " freqs"]  # uniform [Hz]
    nodes: Float[np.ndarray, " nodes"]  # where amplitudes are sampled [Hz]
    accuracy: float = ACCURACY  # of the transform [-]
    _local: threading.local = field(default_factory=threading.local, repr=False)

    def __call__(
        self,
        delays: Float[np.ndarray, " sources"],
        amplitudes: Float[np.ndarray, "nodes sources"] | Complex[np.ndarray, "nodes sources"],
    ) -> Complex[np.ndarray, " freqs"]:
        """Sum ``amplitudes`` delayed by ``delays`` [s]; error about :data:`ACCURACY`."""
        if delays.size == 0:
            return np.zeros(self.frequencies.size, dtype=np.complex128)
        # Whole turns (thousands) are removed in float64, for precision.
        turns = self.centre * delays
        carrier = np.exp(-2j * np.pi * (turns - np.round(turns)))
        steps = self.step * delays
        return self.transform(2 * np.pi * (steps - np.round(steps)), amplitudes * carrier)

    @property
    def step(self) -> float:
        """Step of the frequency grid. [Hz]."""
        count = self.frequencies.size
        return float(self.frequencies[-1] - self.frequencies[0]) / max(count - 1, 1)

    @property
    def centre(self) -> float:
        """Frequency in the middle of the grid, on it. [Hz]."""
        return float(self.frequencies[0]) + (self.frequencies.size // 2) * self.step

    def transform(
        self, phases: Float[np.ndarray, " sources"], terms: Complex[np.ndarray, "nodes sources"]
    ) -> Complex[np.ndarray, " freqs"]:
        """Sum terms whose phase advances by a constant from one frequency to the next.

        Parameters
        ----------
        phases
            2π · step · delay, within ±π. [rad]
        terms
            Amplitudes at the nodes, delayed as at :attr:`centre`.
        """
        count = self.frequencies.size
        if not hasattr(self._local, "plan"):  # plans are not thread-safe: one for each thread
            self._local.plan = finufft.Plan(
                1,
                (count,),
                self.nodes.size,
                eps=self.accuracy,
                isign=-1,
                dtype="complex128",
                nthreads=1,
            )
            self._local.basis = lagrange_basis(self.nodes, self.frequencies)
        self._local.plan.setpts(phases)
        sums = self._local.plan.execute(np.ascontiguousarray(terms, dtype=np.complex128))
        spectrum: np.ndarray = np.einsum(
            "mf,mf->f", self._local.basis, sums.reshape(self.nodes.size, count)
        )
        return spectrum
