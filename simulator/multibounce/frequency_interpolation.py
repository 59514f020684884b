r"""Interpolation over frequency: sums of waves with similar delays, from a few Chebyshev nodes.

Contributions whose delays lie within an interval vary slowly over the band once a common delay is
removed, and are interpolated from a few Chebyshev nodes. If that needs as many nodes as there are
frequencies, every frequency is computed.
"""

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

import finufft
import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from scipy.fft import dct

from simulator.materials.facet_reflection import STEEP
from simulator.materials.fresnel_slab import Conductor, Dielectric, Material, reflection
from simulator.materials.slab_insertion import inserted
from simulator.numerics.nufft_sum import barycentric_basis, chebyshev_nodes

CHAIN_ACCURACY = 1e-4
"""Error of interpolation over the band, and of the sum, relative to the contributions' strength.
Chains are summed in single precision, and the error of physical optics is some 1e-2. [-]"""

MOST_NODES = 4096
"""Most nodes of a chain; one that needs more is computed at every frequency. [-]"""

INCIDENCES = (STEEP, 0.3, 0.5, 0.7, 0.85, 1.0)
"""Cosines of incidence at which the number of nodes is determined. [-]"""


@dataclass(frozen=True)
class EveryFrequency:
    """Sum of contributions whose amplitudes are computed at every frequency."""

    frequencies: Float[np.ndarray, " freqs"]

    @property
    def nodes(self) -> Float[np.ndarray, " nodes"]:
        """Frequencies at which amplitudes are computed: all."""
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


@dataclass(frozen=True)
class FewFrequencies:
    """Sum of contributions whose amplitudes are computed at Chebyshev nodes; thread-safe.

    The sum itself, less its mean delay, is computed at few frequencies too, by a non-uniform
    Fourier transform from delays to nodes, and interpolated.
    """

    frequencies: Float[np.ndarray, " freqs"]
    nodes: Float[np.ndarray, " nodes"]
    _bases: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = field(
        default_factory=dict, repr=False
    )
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def __call__(
        self,
        delays: Float[np.ndarray, " sources"],
        amplitudes: Complex[np.ndarray, "nodes sources"],
    ) -> Complex[np.ndarray, " freqs"]:
        """Sum ``amplitudes`` delayed by ``delays`` [s]."""
        if delays.size == 0:
            return np.zeros(self.frequencies.size, dtype=np.complex128)
        start, stop = float(self.frequencies[0]), float(self.frequencies[-1])
        middle = (float(delays.min()) + float(delays.max())) / 2
        needed = nodes_for_chain(float(np.ptp(delays)), (), start, stop) + self.nodes.size
        points, inner, outer = self._basis(-(-needed // 32) * 32)
        centre = (start + stop) / 2
        turns = centre * (delays - middle)
        carried = amplitudes * np.exp(-2j * np.pi * (turns - np.rint(turns)))
        sums = finufft.nufft1d3(
            2 * np.pi * (delays - middle),
            np.ascontiguousarray(carried, dtype=np.complex128),
            points - centre,
            eps=CHAIN_ACCURACY / 10,
            isign=-1,
            nthreads=1,
        )
        sampled = np.einsum("mp,mp->p", inner, sums.reshape(self.nodes.size, -1))
        turns = self.frequencies * middle
        # Not by matrix product: its rounding would depend on the number of threads.
        spectrum = np.einsum("pf,p->f", outer, sampled)
        return np.asarray(spectrum * np.exp(-2j * np.pi * (turns - np.rint(turns))))

    def _basis(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points at which the sum is computed, and matrices from nodes to points to the band."""
        with self._lock:
            if count not in self._bases:
                start, stop = float(self.frequencies[0]), float(self.frequencies[-1])
                points = chebyshev_nodes(start, stop, count)
                self._bases[count] = (
                    points,
                    barycentric_basis(self.nodes, points),
                    barycentric_basis(points, self.frequencies),
                )
            return self._bases[count]


def few_frequencies(
    frequencies: Float[np.ndarray, " freqs"],
    spread: float,
    materials: Sequence[Material],
    slabs: Sequence[Dielectric],
    pattern_nodes: int,
    interpolate: bool,
) -> FewFrequencies | EveryFrequency:
    """Choose the frequencies at which waves are computed to be summed over the band.

    Parameters
    ----------
    frequencies
        Uniform grid. [Hz]
    spread
        Largest difference of path lengths at one facet. [m]
    materials
        Of the reflecting surfaces.
    slabs
        What the waves cross, patterns included.
    pattern_nodes
        Frequencies at which the patterns of the two antennas are sampled, in all.
    interpolate
        Whether interpolation is allowed.

    Returns
    -------
    The sum over the band of contributions given at its ``nodes``; these are all frequencies if
    interpolation needs no fewer.
    """
    start, stop = float(frequencies[0]), float(frequencies[-1])
    count = nodes_for_chain(spread / speed_of_light, materials, start, stop, slabs=slabs)
    count += pattern_nodes - 2
    if interpolate and count < frequencies.size:
        return FewFrequencies(frequencies, chebyshev_nodes(start, stop, count))
    return EveryFrequency(frequencies)


def nodes_for_chain(
    delay_spread: float,
    materials: Sequence[Material],
    start: float,
    stop: float,
    *,
    slabs: Sequence[Dielectric] = (),
) -> int:
    r"""Count the Chebyshev nodes that interpolate the response of a chain of surfaces over a band.

    The response is a delay, within ± half the spread, times the coefficients of all surfaces. The
    error of interpolation at M nodes is at most twice the sum of the moduli of the Chebyshev
    coefficients from the M-th on (L. N. Trefethen, *Approximation Theory and Approximation
    Practice*, theorem 4.2); they are computed for the longest and the shortest delay, at several
    angles of incidence.

    Parameters
    ----------
    delay_spread
        Width of the interval of delays. [s]
    materials
        Of the surfaces.
    start, stop
        The band. [Hz]
    slabs
        What the waves cross.

    Returns
    -------
    The smallest number whose error is below :data:`CHAIN_ACCURACY`.
    """
    half_phase = np.pi * delay_spread * (stop - start) / 2
    size = 64
    while size < MOST_NODES and size < 2 * half_phase + 64 * (1 + len(materials) + len(slabs)):
        size *= 2
    points = chebyshev_nodes(start, stop, size)[::-1]
    across = (2 * points - start - stop) / (stop - start)
    product = np.ones((len(INCIDENCES), size), dtype=np.complex128)
    for material in materials:
        if not isinstance(material, Conductor):
            product *= reflection(material, points, np.array(INCIDENCES)).te
    for slab in slabs:
        product *= inserted(slab, points, np.array(INCIDENCES)).te
    both = np.exp(1j * half_phase * np.array([1.0, -1.0])[:, None, None] * across) * product
    # dct() expects nodes in descending order, from cos(π/2K).
    coefficients = np.abs(dct(both.real, axis=-1) + 1j * dct(both.imag, axis=-1)) / size
    left_out = 2 * np.cumsum(coefficients[..., ::-1], axis=-1)[..., ::-1].max(axis=(0, 1))
    short = np.flatnonzero(left_out > CHAIN_ACCURACY)
    return max(1, int(short[-1]) + 1) if short.size else 1
