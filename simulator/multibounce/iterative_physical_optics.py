r"""Iterative physical optics: fields of antennas at one surface's facets, via another's.

Line facets (2-D). With the free-space link of a line source, :math:`G = g_0 e^{-jkr}/\sqrt r`,
:math:`g_0 = e^{-j\pi/4}/\sqrt{8\pi k}`, a field is written :math:`h = g_0 \eta`. A wall's facets
w scatter a wave to the facets q of a target by physical optics, in the reciprocal form,

.. math:: \eta_q = \sqrt{\tfrac{k}{8\pi}}\, e^{j\pi/4} \sum_w \Gamma_w
          (\cos\theta_{in} + \cos\theta_{out})\, \eta_w \frac{e^{-jk r_{wq}}}{\sqrt{r_{wq}}}\, ds_w

so that a long flat mirror gives :math:`\Gamma/\sqrt L` over a path of total length L. Each
contribution has one direction of arrival, so its derivative along the normal, over jk, is the
contribution times the cosine of its angle of incidence: the *slope* of the wave. The next surface
needs field and slope, so that chains of surfaces are computed by repetition.

The sum over wall facets is a matrix product at each frequency, with much smaller matrices between
blocks of facets that are far apart (:mod:`simulator.numerics.butterfly`). Without the delay of a
path of mean length, the field varies slowly with frequency.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Complex64, Float, Float32, Int
from scipy.constants import speed_of_light
from threadpoolctl import threadpool_limits

from estimator.compute.engine import thread_count
from simulator.antennas.ports import Ports
from simulator.geometry.faces import Face
from simulator.materials.insertion_table import InsertionTable
from simulator.materials.reflection_table import Angles, reflection_table
from simulator.multibounce.links_through_slabs import BlockInsertions, SlabVariation
from simulator.multibounce.rough_faces import half_angle_cosines, rough_sources
from simulator.numerics.butterfly import LinkPlan, phasor, plan_links, sum_planned
from simulator.visibility.mutual_visibility import Sight

COLUMNS_AT_ONCE = 1024
"""Facets of a target whose single links with a block of a wall are prepared in one batch. [-]"""

LINKS_HELD = 2**24
"""Single links whose geometry is held for all frequencies: 340 MB. [-]"""

FACTOR_BYTES = 2**30
"""Most memory of waves at one frequency in all threads. [byte]"""

GROUP_WIDTH = 1e-3
"""Length of the groups of wall facets by which path lengths are bounded. [m]"""


@dataclass(frozen=True, kw_only=True)
class Wave:
    """Field of ports at the facets of a face, 0 if not illuminated, less a delay.

    The delay is that of the length :attr:`middle`.
    """

    strength: Complex64[np.ndarray, "#nodes ports facets"]  # [m^-1/2]
    slope: Complex64[np.ndarray, "#nodes ports facets"]  # derivative along the normal, over jk
    bounds: "Bounds"

    @property
    def middle(self) -> Float[np.ndarray, "ports facets"]:
        """Length whose delay is removed. [m]."""
        return self.bounds.middle

    def part(self, facets: slice | Int[np.ndarray, " chosen"], port: int) -> "Wave":
        """Select one port and some facets; a single port's wave serves all ports."""
        row = slice(port, port + 1) if self.strength.shape[1] > 1 else slice(None)
        return Wave(
            strength=self.strength[:, row, facets],
            slope=self.slope[:, row, facets],
            bounds=self.bounds.part(facets, row),
        )


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Shortest and longest paths from ports to the facets of a face."""

    shortest: Float[np.ndarray, "ports facets"]  # 0 without any path [m]
    longest: Float[np.ndarray, "ports facets"]  # [m]
    origins: Float[np.ndarray, "ports facets 2"]  # origin of the shortest path's last leg [m]

    @property
    def middle(self) -> Float[np.ndarray, "ports facets"]:
        """Length half way between the shortest and the longest. [m]."""
        middle: np.ndarray = (self.shortest + self.longest) / 2
        return middle

    @property
    def spread(self) -> float:
        """Largest difference of lengths at one facet. [m]."""
        return float((self.longest - self.shortest).max(initial=0.0))

    def part(
        self, facets: slice | Int[np.ndarray, " chosen"], ports: slice = slice(None)
    ) -> "Bounds":
        """Select some of the facets, and of the ports."""
        return Bounds(
            shortest=self.shortest[ports, facets],
            longest=self.longest[ports, facets],
            origins=self.origins[ports, facets],
        )


def quadrature(face: Face, count: int) -> Face:
    """Replace each facet by the points of its Gauss rule, if the phase over it varies."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    points = face.centres[:, None] + nodes[:, None] / 2 * face.edges[:, None]
    repeated = face.part(np.repeat(np.arange(face.count), count))
    return Face(
        centres=points.reshape(-1, 2),
        places=repeated.places,
        normals=repeated.normals,
        sizes=(face.sizes[:, None] * weights / 2).ravel(),
        edges=repeated.edges,
        source=repeated.source,
        surface=face.surface,
        side=face.side,
        material=face.material,
        rough=repeated.rough,
        polarization=face.polarization,
        runs=face.runs,
    )


def direct(face: Face, ports: Ports, nodes: Float[np.ndarray, " nodes"]) -> Wave:
    """Return the free-space wave of ports at the facets that they see from the front.

    Parameters
    ----------
    face
        The receiving face.
    ports
        Antennas, with the visibility of the whole set of facets.
    nodes
        Frequencies at which a pattern that varies over the band is sampled. [Hz]
    """
    towards = ports.positions[:, None, :2] - face.centres
    distance = np.sqrt(np.einsum("pfx,pfx->pf", towards, towards))
    cosine = np.einsum("pfx,fx->pf", towards, face.normals) / distance
    lit = ports.visible[:, face.source] & (cosine > 0)
    strength = _direct_strength(ports, towards, distance, lit, nodes)
    length = np.where(lit, distance, 0.0)
    origins = np.broadcast_to(ports.positions[:, None, :2], towards.shape)
    return Wave(
        strength=strength,
        slope=strength * cosine.astype(np.float32),
        bounds=Bounds(shortest=length, longest=length, origins=origins),
    )


def _direct_strength(
    ports: Ports,
    towards: Float[np.ndarray, "ports facets 2"],
    distance: Float[np.ndarray, "ports facets"],
    lit: Bool[np.ndarray, "ports facets"],
    nodes: Float[np.ndarray, " nodes"],
) -> Complex64[np.ndarray, "#nodes ports facets"]:
    """Return the ports' patterns over the spreading at the facets that they illuminate."""
    rows = len(ports.pattern(np.array([[0.0, 1.0, 0.0]]), np.ones(1), nodes))
    strength = np.zeros((rows, *lit.shape), np.complex64)

    def of_port(port: int) -> None:
        some = np.flatnonzero(lit[port])
        outward = np.zeros((some.size, 3))
        outward[:, :2] = -towards[port, some] / distance[port, some, None]
        gain = ports.pattern(outward, distance[port, some], nodes)
        strength[:, port, some] = gain / np.sqrt(distance[port, some])

    with ThreadPoolExecutor(thread_count()) as pool:  # each port by one thread
        list(pool.map(of_port, range(len(lit))))
    return strength


def onward_bounds(
    arriving: Bounds, wall: Face, target: Face, seen: Bool[np.ndarray, "wall target"]
) -> Bounds:
    """Bound the lengths of the paths from the ports over a wall to a target's facets.

    Parameters
    ----------
    arriving
        Lengths of the paths to the wall.
    wall, target
        The two faces.
    seen
        Visibility between the facets of the wall and of the target.
    """
    firsts = _groups(wall)
    members = np.diff(np.append(firsts, wall.count))
    middles = wall.centres[firsts + members // 2]
    group = np.repeat(np.arange(len(firsts)), members)
    radius = np.zeros(len(firsts))
    np.maximum.at(radius, group, np.linalg.norm(wall.centres - middles[group], axis=-1))
    hidden = ~np.logical_or.reduceat(seen, firsts, axis=0)
    apart = np.linalg.norm(middles[:, None] - target.centres, axis=-1)
    nearest, farthest = apart - radius[:, None], apart + radius[:, None]
    nearest[hidden], farthest[hidden] = np.inf, -np.inf
    lit = arriving.longest > 0
    low = np.minimum.reduceat(np.where(lit, arriving.shortest, np.inf), firsts, axis=1)
    high = np.maximum.reduceat(np.where(lit, arriving.longest, -np.inf), firsts, axis=1)

    def of_port(port: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        lengths = low[port, :, None] + nearest
        first = np.argmin(lengths, axis=0)
        shortest = np.take_along_axis(lengths, first[None], axis=0)[0]
        longest = (high[port, :, None] + farthest).max(axis=0)
        return shortest, longest, middles[first]

    with ThreadPoolExecutor(thread_count()) as pool:
        found = list(pool.map(of_port, range(len(low))))
    shortest, longest, origins = (np.stack(parts) for parts in zip(*found, strict=True))
    arrives = np.isfinite(shortest)
    return Bounds(
        shortest=np.where(arrives, np.maximum(shortest, 0.0), 0.0),
        longest=np.where(arrives, longest, 0.0),
        origins=origins,
    )


def onward(
    wave: Wave,
    wall: Face,
    target: Face,
    sight: Sight,
    bounds: Bounds,
    nodes: Float[np.ndarray, " nodes"],
) -> Wave:
    """Propagate a wave from a wall to a target by physical optics on the wall's facets.

    Parameters
    ----------
    wave
        The wave at the wall: at these nodes, or the same at all frequencies.
    wall, target, sight
        The two faces, which of their facets see each other, and the slabs between these.
    bounds
        Lengths of the paths, after :func:`onward_bounds`.
    nodes
        Frequencies. [Hz]
    """
    seen, ports, columns = sight.seen, len(bounds.shortest), target.count
    shape = (nodes.size, ports, columns)
    strength, slope = np.empty(shape, np.complex64), np.empty(shape, np.complex64)
    if not seen.any():
        return Wave(strength=np.zeros_like(strength), slope=np.zeros_like(slope), bounds=bounds)
    # Angle of the mirror that connects the ports with the middle of the target's visible part.
    towards = target.centres[seen.any(axis=0)].mean(axis=0)
    table = reflection_table(wall.material, nodes, polarization=wall.polarization)
    incidence = table.places(half_angle_cosines(wall, wave.bounds.origins, towards))
    slabs = [InsertionTable.of(one, nodes, wall.polarization) for one in sight.crossings]
    variation = SlabVariation(slabs) if slabs else None
    plan = plan_links(wall.centres, target.centres, seen, float(nodes[-1]), variation=variation)
    between = BlockInsertions.of(plan, slabs)
    single = _SingleLinks.left_by(plan, wall, target, slabs)
    sizes, outward, inward = (
        values.astype(np.float32) for values in (wall.sizes, wall.normals, target.normals)
    )
    aside = np.stack([-outward[:, 1], outward[:, 0]], axis=-1)
    rough = None
    if wall.rough.any():
        centre = float(nodes[nodes.size // 2])
        rough = rough_sources(wall, wave.bounds.origins, target.centres, seen, centre)

    def at_node(node: int) -> None:
        frequency = float(nodes[node])
        here = min(node, len(wave.strength) - 1)
        reflected = table.at(incidence, node) * phasor(wave.middle * (-frequency / speed_of_light))
        reflected = reflected * sizes
        monopoles, dipoles = reflected * wave.slope[here], reflected * wave.strength[here]
        across: np.ndarray | None = None
        if rough is not None:
            monopoles = np.where(wall.rough, dipoles * rough[0], monopoles)
            across, dipoles = dipoles * rough[1], dipoles * rough[2]
        sources = np.stack([monopoles, dipoles * outward[:, 0], dipoles * outward[:, 1]])
        if across is not None:
            sources[1] += across * aside[:, 0]
            sources[2] += across * aside[:, 1]
        inserted = None
        if between is not None:
            inserted = partial(between.at, node=node, per_metre=frequency / speed_of_light)
        field, from_x, from_y = sum_planned(plan, sources, columns, frequency, inserted)
        along_normal = inward[:, 0] * from_x + inward[:, 1] * from_y
        for some in single:
            sideways = None if across is None else across[:, some.rows]
            received = some.received(
                monopoles[:, some.rows], dipoles[:, some.rows], sideways, nodes, node
            )
            field[:, some.columns] += received[0]
            along_normal[:, some.columns] += received[1]
        scale = math.sqrt(frequency / (4 * speed_of_light)) * np.exp(0.25j * np.pi)
        turned = phasor(bounds.middle * (frequency / speed_of_light)) * np.complex64(scale)
        np.multiply(turned, field, out=strength[node])
        np.multiply(turned, along_normal, out=slope[node])

    needed = 64 * ports * (wall.count + columns)
    workers = max(1, min(thread_count(), FACTOR_BYTES // needed))
    # BLAS threads in addition would compete with these: up to 20 times slower.
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(workers) as pool:
        list(pool.map(at_node, range(nodes.size)))
    return Wave(strength=strength, slope=slope, bounds=bounds)


@dataclass(frozen=True, kw_only=True)
class _SingleLinks:
    """Links between facets that are summed one by one."""

    rows: Int[np.ndarray, " wall"]
    columns: Int[np.ndarray, " target"]
    distance: Float[np.ndarray, "wall target"]  # [m]
    spreading: Float32[np.ndarray, "wall target"]  # 0 where hidden [m^-1/2]
    leaves: Float32[np.ndarray, "wall target"]  # cosine to the wall's normal
    aside: Float32[np.ndarray, "wall target"] | None  # along it, if it is rough
    arrives: Float32[np.ndarray, "wall target"]  # cosine to the target's
    slabs: Sequence[tuple[InsertionTable, Angles]]  # crossed, and the angles there

    @classmethod
    def left_by(
        cls, plan: LinkPlan, wall: Face, target: Face, slabs: Sequence[InsertionTable]
    ) -> "Iterable[_SingleLinks]":
        """Prepare the links left by the blocks, in batches; cached, unless too many."""
        if int(plan.left.sum()) > LINKS_HELD:
            return _Anew(lambda: cls._prepared(plan, wall, target, slabs))
        return list(cls._prepared(plan, wall, target, slabs))

    @classmethod
    def _prepared(
        cls, plan: LinkPlan, wall: Face, target: Face, slabs: Sequence[InsertionTable]
    ) -> "Iterator[_SingleLinks]":
        for sender in plan.senders:
            left = plan.left[sender.members]
            rows, columns = sender.members[left.any(axis=1)], np.flatnonzero(left.any(axis=0))
            for first in range(0, columns.size, COLUMNS_AT_ONCE):
                some = columns[first : first + COLUMNS_AT_ONCE]
                between = target.centres[some] - wall.centres[rows, None]
                # For adjacent facets the distance is about 0, and the far field does not apply.
                distance = np.maximum(np.linalg.norm(between, axis=-1), wall.sizes[rows, None] / 2)
                direction = between / distance[..., None]
                links = plan.left[np.ix_(rows, some)] / np.sqrt(distance)
                leaves = np.einsum("wqx,wx->wq", direction, wall.normals[rows])
                arrives = -np.einsum("wqx,qx->wq", direction, target.normals[some])
                aside = None
                if wall.rough.any():
                    tangents = wall.normals[rows][:, ::-1] * np.array([-1.0, 1.0])
                    aside = np.einsum("wqx,wx->wq", direction, tangents).astype(np.float32)
                longer = sum((slab.bending(direction, distance) for slab in slabs), 0.0)
                yield cls(
                    rows=rows,
                    columns=some,
                    distance=distance + longer,
                    spreading=links.astype(np.float32),
                    leaves=leaves.astype(np.float32),
                    aside=aside,
                    arrives=arrives.astype(np.float32),
                    slabs=[(slab, slab.places(direction)) for slab in slabs],
                )

    def received(
        self,
        monopoles: Complex64[np.ndarray, "ports wall"],
        dipoles: Complex64[np.ndarray, "ports wall"],
        across: Complex64[np.ndarray, "ports wall"] | None,
        nodes: Float[np.ndarray, " nodes"],
        node: int,
    ) -> tuple[Complex64[np.ndarray, "ports target"], Complex64[np.ndarray, "ports target"]]:
        """Sum the field, and the field times the cosine at the target."""
        links = self.spreading * phasor(self.distance * (-float(nodes[node]) / speed_of_light))
        for slab, angles in self.slabs:
            links = links * slab.table.at(angles, node)
        turned = links * self.leaves
        strength = monopoles @ links + dipoles @ turned
        slope = monopoles @ (links * self.arrives) + dipoles @ (turned * self.arrives)
        if across is not None and self.aside is not None:
            turned = links * self.aside
            strength += across @ turned
            slope += across @ (turned * self.arrives)
        return strength, slope


@dataclass(frozen=True)
class _Anew:
    """Iterable that makes its items anew in each iteration."""

    make: "Callable[[], Iterator[_SingleLinks]]"

    def __iter__(self) -> "Iterator[_SingleLinks]":
        return self.make()


def _groups(wall: Face) -> np.ndarray:
    """Return the first facets of groups of neighbours about :data:`GROUP_WIDTH` long."""
    steps = np.linalg.norm(np.diff(wall.centres, axis=0), axis=-1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    return np.unique(along // GROUP_WIDTH, return_index=True)[1]
