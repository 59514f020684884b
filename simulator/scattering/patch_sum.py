"""Sums over any number of triangles: by patches, at a few frequencies and positions."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from scipy.constants import speed_of_light
from threadpoolctl import threadpool_limits

from estimator.compute.engine import thread_count
from simulator.antennas.links import Links
from simulator.geometry.facets import Facets
from simulator.geometry.patches import Patches, cut_into_patches, patch_side
from simulator.materials.facet_reflection import echo_coefficient, reflection_nodes
from simulator.materials.fresnel_slab import Absorber, Conductor, Material
from simulator.numerics.nufft_sum import FrequencySum, chebyshev_nodes, lagrange_basis, nodes_needed
from simulator.scattering.aperture_interpolation import GAIN, Aperture, find_aperture, node_counts
from simulator.scattering.patch_kernel import PatchKernel
from simulator.visibility.seen import Seen

ACCURACY = 3e-5
"""Largest error of the interpolation of a patch's sum over the band. [-]"""

COEFFICIENT_ACCURACY = 1e-4
"""Largest error of the interpolation of a coefficient of reflection over the band. [-]"""

FACETS_AT_ONCE = 2_000_000
"""Triangles whose visibility is tested in one batch. [-]"""

TABLE_AT_ONCE = 2**28
"""Triangles times links whose visibility may be held at one time: 256 MiB. [-]"""

LANES_AT_ONCE = 1_000_000
"""Patches times links in one kernel: 200 MB of sums. [-]"""

MASKED_AT_ONCE = 2**27
"""Triangles times links of one visibility mask: 128 MiB. [-]"""

LINKS_AT_ONCE = 32
"""Links interpolated by one matrix product, on one thread. [-]"""


Look = Callable[[Int[np.ndarray, " facets"]], Seen]
"""Returns over which links triangles of the whole set are seen."""

Factor = Callable[
    [Links, Float[np.ndarray, "patches 3"], Float[np.ndarray, " nodes"]],
    Complex[np.ndarray, "patches links nodes"],
]
"""Factor of the sum over a patch, which varies as slowly as an antenna's pattern."""


def scattered_by_patches(
    facets: Facets,
    links: Links,
    look: Look,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    chosen: Bool[np.ndarray, " facets"] | None = None,
    factor: Factor | None = None,
    factor_nodes: int = 1,
    advance: Callable[[], None] = lambda: None,
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the facets' scattering for each link, with spherical waves.

    Parameters
    ----------
    facets
        Triangles.
    links
        Positions and patterns of both ends.
    look
        Visibility test of triangles.
    frequencies
        Uniform grid. [Hz]
    chosen
        Which of the facets are summed; None: all.
    factor, factor_nodes
        Further factor of each patch's sum, and the frequencies at which it is sampled.
    advance
        Called once for each link, as the work proceeds.

    Returns
    -------
    S-parameter of each link. [-]
    """
    count = len(links.receivers)
    spectrum = np.zeros((count, frequencies.size), dtype=np.complex128)
    start, stop = float(frequencies[0]), float(frequencies[-1])
    side = patch_side(facets, stop - start)
    chosen = np.ones(facets.count, dtype=bool) if chosen is None else chosen
    done, told, whole = 0, 0, int(np.count_nonzero(chosen))
    for material, share, mask in facets.by_material:
        some = np.flatnonzero(chosen if mask is None else chosen & mask)
        if isinstance(material, Absorber) or some.size == 0:
            continue
        patches = cut_into_patches(facets, some, side)
        work = _Work(patches, (material, share), links, frequencies, factor, factor_nodes)
        part = np.zeros_like(spectrum)
        for block in _blocks(patches, min(FACETS_AT_ONCE, max(1, TABLE_AT_ONCE // count))):
            part += work.block(block, look)
            done += len(block.order)
            while told < count * done // whole:
                told += 1
                advance()
        if links.echo and not isinstance(material, Conductor):
            part *= echo_coefficient(material, frequencies)
        spectrum += part
    for _ in range(told, count):
        advance()
    return 1j * spectrum


def _blocks(patches: Patches, most: int) -> Iterator[Patches]:
    """Yield blocks of consecutive patches with up to that many triangles."""
    begin = 0
    while begin < patches.count:
        end = int(np.searchsorted(patches.first, patches.first[begin] + most, side="right")) - 1
        end = max(end, begin + 1)
        yield patches.patch_range(begin, end)
        begin = end


class _Work:
    """One material's patches, and the frequencies and positions at which they are summed."""

    def __init__(
        self,
        patches: Patches,
        kind: tuple[Material, float | None],
        links: Links,
        frequencies: Float[np.ndarray, " freqs"],
        factor: Factor | None,
        factor_nodes: int,
    ) -> None:
        material, self.share = kind
        start, stop = float(frequencies[0]), float(frequencies[-1])
        delays = 4 * float(patches.radii.max()) / speed_of_light  # both legs, ± radius
        nodes = nodes_needed(delays, stop - start, accuracy=ACCURACY)
        if not links.echo:
            nodes += reflection_nodes(material, start, stop, accuracy=COEFFICIENT_ACCURACY) - 1
        # The triangles are summed at few frequencies; the factor may need more.
        self.few = chebyshev_nodes(start, stop, nodes)
        self.total = FrequencySum(
            frequencies, chebyshev_nodes(start, stop, nodes + factor_nodes - 1)
        )
        self.material, self.links, self.factor = material, links, factor
        self.aperture = find_aperture(links)

    def block(self, patches: Patches, look: Look) -> Complex[np.ndarray, "links freqs"]:
        """Sum some patches."""
        count = len(self.links.receivers)
        spectrum = np.zeros((count, self.total.frequencies.size), dtype=np.complex128)
        seen = look(patches.order)
        always = np.flatnonzero(seen.always)
        if always.size:
            for part, aperture, counts in self._by_nodes(patches.part(always)):
                for some in _blocks_of(part, LANES_AT_ONCE // _product(counts, count)):
                    self._add(spectrum, some, aperture, counts)
        for rows in np.array_split(
            np.arange(len(seen.sometimes)), 1 + len(seen.sometimes) * count // MASKED_AT_ONCE
        ):
            if rows.size:
                part = patches.part(seen.sometimes[rows])
                self._add(spectrum, part, None, None, mask=seen.table[rows])
        return spectrum

    def _by_nodes(
        self, patches: Patches
    ) -> Iterator[tuple[Patches, Aperture | None, tuple[int, ...] | None]]:
        """Yield groups of patches that need the same nodes."""
        count = len(self.links.receivers)
        if self.aperture is None or count < 3:
            yield patches, None, None
            return
        highest = float(self.total.frequencies[-1])
        counts = node_counts(self.aperture, self.links, patches, highest)
        worth = (counts > 0).all(axis=1) & (np.prod(counts, axis=1) <= GAIN * count)
        counts[~worth] = 0
        kinds, kind = np.unique(counts, axis=0, return_inverse=True)
        for index, chosen in enumerate(kinds.tolist()):
            owner = np.repeat(kind.ravel() == index, np.diff(patches.first))
            part = patches.part(np.flatnonzero(owner))
            if all(chosen):
                yield part, self.aperture, tuple(chosen)
            else:
                yield part, None, None

    def _add(
        self,
        spectrum: Complex[np.ndarray, "links freqs"],
        patches: Patches,
        aperture: Aperture | None,
        counts: tuple[int, ...] | None,
        *,
        mask: Bool[np.ndarray, "facets links"] | None = None,
    ) -> None:
        kernel = PatchKernel(patches, self.material, self.few, share=self.share)
        links, basis = self.links, None
        if aperture is not None and counts is not None:
            links, basis = aperture.nodes(counts, links)
        sums = kernel(links, mask)
        if self.factor is not None:
            between = lagrange_basis(self.few, self.total.nodes).astype(np.float32)
            sums = np.einsum("pln,nm->plm", sums, between)
            sums *= self.factor(links, patches.centres, self.total.nodes)
        shape = (patches.count, self.total.nodes.size)
        # [places, patches x nodes x 2]
        places = np.ascontiguousarray(np.moveaxis(sums, 1, 0)).reshape(sums.shape[1], -1)
        rows = places.view(np.float32)

        def some_links(first: int) -> None:
            block = slice(first, first + LINKS_AT_ONCE)
            if basis is None:
                terms = places[block]
            else:
                terms = np.matmul(basis[block].astype(np.float32), rows).view(np.complex64)
            for link, values in zip(range(first, first + len(terms)), terms, strict=True):
                delays = self._lengths(link, patches) / speed_of_light
                spectrum[link] += self.total(delays, values.reshape(shape).T)

        # On one thread each: the rounding of a product depends on its shape alone.
        with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(thread_count()) as pool:
            list(pool.map(some_links, range(0, len(spectrum), LINKS_AT_ONCE)))

    def _lengths(self, link: int, patches: Patches) -> Float[np.ndarray, " patches"]:
        total = np.zeros(patches.count)
        for place in (self.links.senders[link], self.links.receivers[link]):
            apart = patches.centres - place
            total += np.sqrt(np.einsum("px,px->p", apart, apart))
        return total


def _product(counts: tuple[int, ...] | None, otherwise: int) -> int:
    return otherwise if counts is None else int(np.prod(counts))


def _blocks_of(patches: Patches, most: int) -> Iterator[Patches]:
    """Yield blocks of at most that many consecutive patches."""
    for begin in range(0, patches.count, max(1, most)):
        yield patches.patch_range(begin, min(begin + max(1, most), patches.count))
