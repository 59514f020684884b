r"""One-way waves over legs of which one rough mirror scatters diffusely, the others specularly.

The diffuse part is the scattering of the rough mirror's facets less its mean over realisations,
which is physical optics of the mean plane times
:math:`e^{-k^2\sigma^2(\cos\theta_i+\cos\theta_s)^2/2}` (Gaussian heights). The mean plane's facets
are the rough ones projected onto it, so that both sums have the same footprint and visibility.
Mirrors before and after it are represented by images of either end.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from scipy.constants import speed_of_light

from simulator.antennas.beam_culling import AntennaGroup, in_reach
from simulator.antennas.links import Links
from simulator.geometry.facets import Facets
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.patches import cut_into_patches
from simulator.geometry.ray_scene import blocked
from simulator.materials.facet_reflection import reflection_nodes
from simulator.scattering.patch_sum import COEFFICIENT_ACCURACY, Factor, Look, scattered_by_patches
from simulator.scene.radio_scene import RadioScene
from simulator.specular.diffuse_chains import DIFFUSE_LEVEL, DiffuseLeg
from simulator.specular.image_method import ROUGHNESS_CLEARANCE, trace_chain
from simulator.specular.image_sources import Leg, LegReflection
from simulator.visibility.seen import Seen
from simulator.visibility.shaft_culling import TILE, Sightlines, object_shape, scenario_obstacles

FACETS_AT_ONCE = 500_000
"""Facets of the rough mirror summed, with their mean plane's, in one batch: 110 MB. [-]"""

TRACED_SIDE = 0.02
"""Side of the patches whose visibility over mirrors is traced at one of their facets. [m]"""

SAMPLE_SIDE = 0.04
"""Spacing of sample points that test whether a leg over several mirrors exists at all. [m]"""

LEAST_PEAK = 0.3
"""Product of two field patterns, relative to their peaks, that some point on a rough mirror must
reach for a chain over further mirrors to be simulated: -10 dB. [-]"""

TILE_RADIUS = TILE * 2**-0.5  # of a tile's circumscribed circle [m]

MOST_SAMPLES = 50_000
"""Facets from which those sample points are taken. [-]"""

LOSS_NODES = 2
"""Additional frequencies for interpolating a Gaussian loss over a band. [-]"""


def diffuse_wave(
    scene: RadioScene,
    chain: DiffuseLeg,
    array: AntennaGroup,
    other: AntennaGroup,
    *,
    beside: str | None = None,
    factor: Factor | None = None,
    factor_nodes: int = 1,
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the diffuse scattering of a rough mirror between an array and one place.

    Parameters
    ----------
    scene
        The frozen scene.
    chain
        The leg, and its rough mirror.
    array
        The array's antennas.
    other
        A single antenna: a user's, or an isotropic one at a target.
    beside
        The object on which the place is; it does not hide the place.
    factor, factor_nodes
        Further factor of each patch's sum, and the frequencies at which it is sampled.

    Returns
    -------
    S-parameter of each of the array's antennas with the other one. [-]
    """
    frequencies = scene.scenario.radio.frequencies
    spectrum = np.zeros((len(array.positions), frequencies.size), dtype=np.complex128)
    if scene.mirrors is None or scene.facets is None:
        return spectrum
    mirrors = scene.mirrors.mirrors
    near, far = chain.before.image(array), chain.after.image(other)
    if not _may_lead_there(mirrors, chain, near, far):
        return spectrum
    some = facets_within_reach(scene, chain, near, far)
    if some.size == 0 or not _leads_there(scene, chain, array, other, some):
        return spectrum
    looks = (
        _look(scene, chain, chain.before, array, beside=None),
        _look(scene, chain, chain.after, other, beside=beside),
    )
    start, stop = float(frequencies[0]), float(frequencies[-1])
    reflection = LegReflection(mirrors=mirrors, out=chain.after, back=chain.before)
    nodes = factor_nodes
    for mirror in (*chain.before.sequence, *chain.after.sequence):
        nodes += (
            reflection_nodes(mirrors.materials[mirror], start, stop, accuracy=COEFFICIENT_ACCURACY)
            - 1
        )
        nodes += LOSS_NODES
    links = Links(
        senders=np.broadcast_to(far.positions, near.positions.shape),
        receivers=near.positions,
        sent=far.pattern,
        received=near.pattern,
    )
    loss = _MeanLoss(normal=mirrors.normals[chain.rough], rms=mirrors.rms_heights[chain.rough])
    for block in _slabs(scene.facets, some):
        part = scene.facets.part(block)
        look = partial(_some_of, _both(looks[0](block), looks[1](block)), len(block))
        flat = _on_mean_plane(part, mirrors, chain.rough)
        for facets, sign, losses, more in ((part, 1.0, None, 0), (flat, -1.0, loss, LOSS_NODES)):
            factors = [one for one in (reflection, factor, losses) if one is not None]
            spectrum += sign * scattered_by_patches(
                facets,
                links,
                look,
                frequencies,
                factor=partial(_product, factors),
                factor_nodes=nodes + more,
            )
    return spectrum


@dataclass(frozen=True, kw_only=True)
class _MeanLoss:
    """Mean over realisations of a patch's sum, relative to the mean plane's."""

    normal: Float[np.ndarray, " 3"]
    rms: float

    def __call__(
        self,
        links: Links,
        centres: Float[np.ndarray, "patches 3"],
        nodes: Float[np.ndarray, " nodes"],
    ) -> Float[np.ndarray, "patches links nodes"]:
        cosines = np.zeros((len(centres), len(links.receivers)))
        for places in (links.senders, links.receivers):
            towards = places - centres[:, None]
            lengths = np.sqrt(np.einsum("plx,plx->pl", towards, towards))
            cosines += np.einsum("plx,x->pl", towards, self.normal) / lengths
        wavenumbers = 2 * np.pi * nodes / speed_of_light
        loss: np.ndarray = np.exp(-0.5 * (self.rms * wavenumbers * cosines[..., None]) ** 2)
        return loss


def _product(
    factors: Sequence[Factor],
    links: Links,
    centres: Float[np.ndarray, "patches 3"],
    nodes: Float[np.ndarray, " nodes"],
) -> Complex[np.ndarray, "patches links nodes"]:
    shape = (len(centres), len(links.receivers), nodes.size)
    total: np.ndarray = np.ones(shape, dtype=np.complex128)
    for factor in factors:
        total *= factor(links, centres, nodes)
    return total


def facets_within_reach(
    scene: RadioScene, chain: DiffuseLeg, near: AntennaGroup, far: AntennaGroup
) -> Int[np.ndarray, " some"]:
    """Return the rough mirror's facets within the product of both patterns, by tiles."""
    among, facets = scene.mirrors, scene.facets
    nothing = np.empty(0, dtype=np.int64)
    if among is None or facets is None or facets.material is None:
        return nothing
    owner = among.owners[chain.rough]
    if owner not in scene.scattering:
        return nothing
    mirrors = among.mirrors
    tiles = _Tiles.of(mirrors, chain.rough)
    reached = in_reach([(near, far)], tiles.middles, TILE_RADIUS, level=DIFFUSE_LEVEL)
    if not reached.any():
        return nothing
    of_owner = np.flatnonzero(facets.material == scene.scattering.index(owner))
    limit: float = (
        ROUGHNESS_CLEARANCE * mirrors.rms_heights[chain.rough] + scene.rays_to_all.clearance
    )
    kept = []
    for some in np.array_split(of_owner, 1 + of_owner.size // FACETS_AT_ONCE):
        centres = facets.centres[some]
        on_face = np.abs(mirrors.heights(centres, chain.rough)) <= limit
        kept.append(some[on_face & reached[tiles.numbers(centres)]])
    return np.concatenate(kept)


@dataclass(frozen=True, kw_only=True)
class _Tiles:
    """Squares that cover a mirror."""

    corner: Float[np.ndarray, " 3"]  # first corner of the grid [m]
    axes: Float[np.ndarray, "2 3"]  # along their sides
    counts: tuple[int, int]

    @classmethod
    def of(cls, mirrors: Mirrors, mirror: int) -> "_Tiles":
        corners, normal = mirrors.corners[mirror], mirrors.normals[mirror]
        along = (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
        axes = np.stack([along, np.cross(normal, along)])
        spans = np.einsum("cx,ax->ca", corners - corners[0], axes)
        low, high = spans.min(axis=0), spans.max(axis=0)
        first, second = np.floor((high - low) / TILE).astype(np.int64) + 1
        corner = corners[0] + np.einsum("a,ax->x", low, axes)
        return cls(corner=corner, axes=axes, counts=(int(first), int(second)))

    @property
    def middles(self) -> Float[np.ndarray, "tiles 3"]:
        """Centres of the tiles [m]."""
        grid = np.stack(np.meshgrid(*(np.arange(n) for n in self.counts), indexing="ij"), axis=-1)
        middles = self.corner + np.einsum("ija,ax->ijx", (grid + 0.5) * TILE, self.axes)
        return np.asarray(middles.reshape(-1, 3))

    def numbers(self, places: Float[np.ndarray, "places 3"]) -> Int[np.ndarray, " places"]:
        """Return the index of the tile of each place on the mirror."""
        along = np.einsum("px,ax->pa", places - self.corner, self.axes)
        cells = np.clip(np.floor(along / TILE).astype(np.int64), 0, np.array(self.counts) - 1)
        numbers: Int[np.ndarray, " places"] = cells[:, 0] * self.counts[1] + cells[:, 1]
        return numbers


def _may_lead_there(
    mirrors: Mirrors, chain: DiffuseLeg, near: AntennaGroup, far: AntennaGroup
) -> bool:
    """Return whether a tile of the rough mirror may be within both beams, without occlusion."""
    if not chain.before.bounces and not chain.after.bounces:
        return True  # each facet is looked at, anyway
    middles = _Tiles.of(mirrors, chain.rough).middles
    bright = near.at_most(middles, TILE_RADIUS) * far.at_most(middles, TILE_RADIUS)
    return bool(np.any(bright >= LEAST_PEAK))


def _leads_there(
    scene: RadioScene,
    chain: DiffuseLeg,
    array: AntennaGroup,
    other: AntennaGroup,
    some: Int[np.ndarray, " some"],
) -> bool:
    """Return whether both ends see a sample point of the rough mirror within their beams."""
    if scene.facets is None:
        return False
    if not chain.before.bounces and not chain.after.bounces:
        return True  # each facet is looked at, anyway
    few = scene.facets.part(some[:: max(1, some.size // MOST_SAMPLES)])
    tiles = cut_into_patches(few, np.arange(few.count), SAMPLE_SIDE)
    points = few.centres[tiles.order[tiles.first[:-1]]]
    corners = AntennaGroup(positions=array.outline, pattern=array.pattern)
    seen = [
        _traced(scene, chain, leg, sight, points).any(axis=0)
        for leg, sight in ((chain.after, other), (chain.before, corners))
    ]
    # The patterns' product there, relative to their peaks.
    bright = chain.before.image(array).at_most(points, 0.0)
    bright = bright * chain.after.image(other).at_most(points, 0.0)
    return bool((seen[0] & seen[1] & (bright >= LEAST_PEAK)).any())


def _traced(
    scene: RadioScene,
    chain: DiffuseLeg,
    leg: Leg,
    sight: AntennaGroup,
    points: Float[np.ndarray, "points 3"],
) -> Bool[np.ndarray, "antennas points"]:
    """Return which antennas see which points of a rough mirror over a leg, by rays."""
    if scene.mirrors is None:
        return np.zeros((len(sight.positions), len(points)), dtype=bool)
    mirrors = scene.mirrors.mirrors
    side = np.sign(mirrors.heights(leg.image(sight).centre[None], chain.rough)[0])
    lift = scene.rays_to_all.clearance + ROUGHNESS_CLEARANCE * mirrors.rms_heights[chain.rough]
    offset = lift * side * mirrors.normals[chain.rough]
    valid: np.ndarray = trace_chain(
        mirrors,
        leg.sequence,
        sight.positions,
        points,
        blocked=partial(blocked, scene.rays_to_all),
        clearance=scene.rays_to_all.clearance,
        receiver_offsets=np.broadcast_to(offset, points.shape),
    ).valid
    return valid


def _slabs(facets: Facets, some: Int[np.ndarray, " some"]) -> Iterator[Int[np.ndarray, " block"]]:
    """Yield blocks of neighbouring facets."""
    axis = int(np.argmax([np.ptp(facets.centres[some, k]) for k in range(3)]))
    order = np.argsort(facets.centres[some, axis], kind="stable")
    yield from np.array_split(some[order], 1 + some.size // FACETS_AT_ONCE)


def _on_mean_plane(facets: Facets, mirrors: Mirrors, mirror: int) -> Facets:
    """Project facets onto the plane of a mirror."""
    normal = mirrors.normals[mirror]
    edges = facets.edges - np.einsum("fex,x->fe", facets.edges, normal)[..., None] * normal
    across = np.cross(edges[:, 0], edges[:, 1])
    doubled = np.sqrt(np.einsum("fx,fx->f", across, across))
    heights = mirrors.heights(facets.centres, mirror)
    return replace(
        facets,
        centres=facets.centres - heights[:, None] * normal,
        normals=across / doubled[:, None],
        sizes=doubled / 2,
        edges=edges,
        relief=None,
    )


def _look(
    scene: RadioScene, chain: DiffuseLeg, leg: Leg, sight: AntennaGroup, *, beside: str | None
) -> Look:
    if leg.sequence:
        return partial(_look_over_mirrors, scene, chain, leg, sight)
    known, facets = list(scene.scenario.objects), scene.facets
    if facets is None:
        raise ValueError("the scene has no facets; give a scene with a scattering object")
    return Sightlines(
        rays=scene.rays_to_all,
        facets=facets,
        senders=sight.positions,
        receivers=sight.positions,
        obstacles=[one for one in scenario_obstacles(scene.scenario) if known[one.owner] != beside],
        shapes=[object_shape(scene.scenario, name) for name in scene.scattering],
        objects=[known.index(name) for name in scene.scattering],
    )


def _look_over_mirrors(
    scene: RadioScene,
    chain: DiffuseLeg,
    leg: Leg,
    sight: AntennaGroup,
    some: Int[np.ndarray, " some"],
) -> Seen:
    """Return visibility over a leg, traced at one facet of each small patch."""
    if scene.mirrors is None or scene.facets is None:
        raise ValueError("the scene has no facets; give a scene with a scattering object")
    facets = scene.facets.part(some)
    patches = cut_into_patches(facets, np.arange(len(some)), TRACED_SIDE)
    best = patches.order[patches.first[:-1] + np.diff(patches.first) // 2]
    valid = _traced(scene, chain, leg, sight, facets.centres[best])
    patch_of = np.empty(len(some), dtype=np.int64)
    patch_of[patches.order] = np.repeat(np.arange(patches.count), np.diff(patches.first))
    always, ever = np.asarray(valid.all(axis=0)), np.asarray(valid.any(axis=0))
    mixed = np.flatnonzero((ever & ~always)[patch_of])
    return Seen(
        always=always[patch_of],
        sometimes=mixed,
        table=np.ascontiguousarray(valid[:, patch_of[mixed]].T),
    )


def _both(array: Seen, other: Seen) -> Seen:
    """Combine the visibility from the array's antennas with that from the single other one."""
    kept = other.always[array.sometimes]
    return Seen(
        always=array.always & other.always,
        sometimes=array.sometimes[kept],
        table=np.ascontiguousarray(array.table[kept]),
    )


def _some_of(seen: Seen, count: int, some: Int[np.ndarray, " some"]) -> Seen:
    """Select the visibility of some facets from that of all."""
    row: Int[np.ndarray, " count"] = np.full(count, -1)
    row[seen.sometimes] = np.arange(len(seen.sometimes))
    rows = row[some]
    sometimes = np.flatnonzero(rows >= 0)
    chosen: Bool[np.ndarray, " some"] = seen.always[some]
    return Seen(
        always=chosen,
        sometimes=sometimes,
        table=np.ascontiguousarray(seen.table[rows[sometimes]]),
    )
