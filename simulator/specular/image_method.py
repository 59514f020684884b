"""Specular paths over finite flat mirrors, by the method of images, in double precision.

One :class:`Chain` holds all paths over the same sequence of mirrors, from many sources to
many receivers at once: along a chain, lengths and angles vary smoothly over the array.
"""

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from simulator.geometry.mirrors import Mirrors, dot
from simulator.geometry.ray_scene import CLEARANCE
from simulator.geometry.slabs import Slabs

ROUGHNESS_CLEARANCE = 6.0
"""Additional clearance of a segment from a rough mirror, in rms heights: a Gaussian height exceeds
it with a probability of 1e-9. [-]"""

ON_PLANE = 1e-9
"""Distance below which a point counts as in the mirror's plane, and has no image. [m]"""

PAIRS_AT_ONCE = 500_000
"""Source-receiver pairs traced in one batch: some 50 MB for each vector quantity. [-]"""

Blocked = Callable[
    [Float[np.ndarray, "rays 3"], Float[np.ndarray, "rays 3"]], Bool[np.ndarray, " rays"]
]
"""Returns which straight segments, from starts to ends, meet a surface."""


@dataclass(frozen=True, kw_only=True)
class Chain:
    """All paths over one sequence of mirrors; an empty sequence is the line of sight.

    Paths are in the order of ``np.nonzero(valid)``: ``dense[chain.valid] = chain.lengths``.
    """

    mirrors: tuple[int, ...]  # from the source onward
    valid: Bool[np.ndarray, "sources receivers"]
    lengths: Float[np.ndarray, " paths"]  # [m]
    vertices: Float[np.ndarray, "paths bounces 3"]  # points of reflection [m]
    cosines: Float[np.ndarray, "paths bounces"]  # of the angles of incidence [-]
    directions: Float[np.ndarray, "paths legs 3"]  # unit vectors of travel, bounces + 1 legs
    crossed: Int[np.ndarray, "paths legs"] | None = None  # sets of slabs on each leg; None: none
    bent_at: int | None = None  # bounce that reflects as the mirror between its legs; None: none

    @property
    def departures(self) -> Float[np.ndarray, "paths 3"]:
        """Unit vectors from the source outward."""
        return self.directions[:, 0]

    @property
    def arrivals(self) -> Float[np.ndarray, "paths 3"]:
        """Unit vectors from the receiver outward, against the direction of travel."""
        outward: np.ndarray = -self.directions[:, -1]
        return outward


def find_chains(
    mirrors: Mirrors,
    sources: Float[np.ndarray, "sources 3"],
    receivers: Float[np.ndarray, "receivers 3"],
    *,
    blocked: Blocked,
    clearance: float = CLEARANCE,
    max_bounces: int = 3,
    min_bounces: int = 0,
    receivers_on: int | None = None,
    receiver_offsets: Float[np.ndarray, "receivers 3"] | None = None,
    slabs: Slabs | None = None,
    among: Iterable[tuple[int, ...]] | None = None,
) -> tuple[Chain, ...]:
    """Find all specular paths of up to ``max_bounces`` bounces.

    Parameters
    ----------
    mirrors
        The mirrors; none reflects twice in succession.
    sources, receivers
        End points; every source is linked with every receiver. [m]
    blocked
        Occlusion test, called with float64 segments that begin and end just off the mirrors.
    clearance
        Distance of these ends from the mirrors; larger scenes may need more. [m]
    max_bounces, min_bounces
        Bounces of the chains to return; 0 is the line of sight.
    receivers_on
        Mirror that the receivers lie on (facets of its rough surface): no chain ends with it.
    receiver_offsets
        Moves the receivers, for the occlusion test only, off the surface they lie on. [m]
    slabs
        Transmitting surfaces; the chains record which of them their legs cross.
    among
        Candidate sequences of mirrors, from the sources onward; None: all are tried.

    Returns
    -------
    The chains with at least one path: by number of bounces, then by the order of mirrors.
    """
    ends = receivers if receiver_offsets is None else receivers + receiver_offsets
    found = []
    candidates = _sequences(mirrors, sources, max_bounces)
    if among is not None:
        candidates = _given(mirrors, sources, among, max_bounces)
    for sequence, images in candidates:
        last_is_own = bool(sequence) and sequence[-1] == receivers_on
        if len(sequence) < min_bounces or last_is_own:
            continue
        chain = _trace(
            mirrors, sequence, images, sources, receivers, ends, blocked, clearance, slabs=slabs
        )
        if chain.lengths.size:
            found.append(chain)
    return tuple(sorted(found, key=lambda chain: (len(chain.mirrors), chain.mirrors)))


def trace_chain(
    mirrors: Mirrors,
    sequence: tuple[int, ...],
    sources: Float[np.ndarray, "sources 3"],
    receivers: Float[np.ndarray, "receivers 3"],
    *,
    blocked: Blocked,
    clearance: float = CLEARANCE,
    receiver_offsets: Float[np.ndarray, "receivers 3"] | None = None,
    paired: bool = False,
    slabs: Slabs | None = None,
) -> Chain:
    """Find the specular paths over one given sequence of mirrors; see :func:`find_chains`.

    Parameters
    ----------
    mirrors, sources, receivers, blocked, clearance, receiver_offsets, slabs
        See :func:`find_chains`.
    sequence
        The mirrors, from the source onward.
    paired
        Each source is linked with the receiver of the same index only.
    """
    images = _images(mirrors, sequence, sources)
    ends = receivers if receiver_offsets is None else receivers + receiver_offsets
    return _trace(
        mirrors,
        sequence,
        images,
        sources,
        receivers,
        ends,
        blocked,
        clearance,
        paired=paired,
        slabs=slabs,
    )


def _images(
    mirrors: Mirrors, sequence: tuple[int, ...], sources: Float[np.ndarray, "sources 3"]
) -> Float[np.ndarray, "bounces sources 3"]:
    """Mirror sources in one mirror after the other."""
    images = np.empty((len(sequence), *sources.shape))
    latest = sources
    for bounce, mirror in enumerate(sequence):
        images[bounce] = latest = mirrors.images(latest, mirror)
    return images


def unfolded_chain(
    mirrors: Mirrors,
    sequence: tuple[int, ...],
    images: Float[np.ndarray, "sources 3"],
    receivers: Float[np.ndarray, "receivers 3"],
    *,
    paired: bool = False,
) -> Chain:
    """Return paths over a sequence of mirrors taken as infinite planes, without occlusion.

    Parameters
    ----------
    mirrors, sequence
        The mirrors, from the source onward.
    images
        Images of the sources behind the last of them. [m]
    receivers
        Every image is linked with every receiver. [m]
    paired
        Each image is linked with the receiver of the same index only.
    """
    unfolded = receivers - images if paired else (receivers - images[:, None]).reshape(-1, 3)
    lengths = np.sqrt(dot(unfolded, unfolded))
    directions, cosines = folded_back(mirrors, sequence, unfolded / lengths[:, None])
    return Chain(
        mirrors=sequence,
        valid=np.eye(len(images), dtype=bool)
        if paired
        else np.ones((len(images), len(receivers)), dtype=bool),
        lengths=lengths,
        vertices=np.full((len(lengths), len(sequence), 3), np.nan),
        cosines=cosines,
        directions=directions,
    )


def folded_back(
    mirrors: Mirrors, sequence: tuple[int, ...], last: Float[np.ndarray, "paths 3"]
) -> tuple[Float[np.ndarray, "paths legs 3"], Float[np.ndarray, "paths bounces"]]:
    """Directions of all legs, and cosines of incidence, from the directions of the last leg."""
    directions = [last]
    for mirror in reversed(sequence):
        directions.append(mirrors.turned(directions[-1], mirror))
    directions = directions[::-1]
    cosines = [
        np.abs(dot(direction, mirrors.normals[mirror]))
        for direction, mirror in zip(directions[1:], sequence, strict=True)
    ]
    stacked = np.stack(cosines, axis=-1) if sequence else np.empty((len(last), 0))
    return np.stack(directions, axis=1), stacked


_Images = Float[np.ndarray, "bounces sources 3"]


def _sequences(
    mirrors: Mirrors, sources: Float[np.ndarray, "sources 3"], max_bounces: int
) -> Iterator[tuple[tuple[int, ...], _Images]]:
    """Yield sequences of mirrors, extended one by one, with the sources' images in each."""
    stack: list[tuple[tuple[int, ...], _Images]] = [((), np.empty((0, *sources.shape)))]
    while stack:
        sequence, images = stack.pop()
        yield sequence, images
        if len(sequence) == max_bounces:
            continue
        latest = images[-1] if sequence else sources
        for mirror in np.flatnonzero(within_reach(mirrors, sequence, latest)).tolist():
            image = mirrors.images(latest, mirror)
            stack.append(((*sequence, mirror), np.concatenate([images, image[None]])))


def _given(
    mirrors: Mirrors,
    sources: Float[np.ndarray, "sources 3"],
    among: Iterable[tuple[int, ...]],
    max_bounces: int,
) -> Iterator[tuple[tuple[int, ...], _Images]]:
    """Give sequences that were found otherwise the images of the sources, and the direct one."""
    for sequence in itertools.chain([()], among):
        if len(sequence) <= max_bounces:
            yield sequence, _images(mirrors, sequence, sources)


def within_reach(
    mirrors: Mirrors, sequence: tuple[int, ...], latest: Float[np.ndarray, "sources 3"]
) -> Bool[np.ndarray, " mirrors"]:
    """Return which mirrors the beams from the latest images may meet next (conservative)."""
    heights = dot(latest[:, None] - mirrors.corners[None, :, 0], mirrors.normals)
    reflects = np.where(mirrors.two_sided, np.abs(heights), heights) > ON_PLANE
    if not sequence:
        first: np.ndarray = np.any(reflects, axis=0)
        return first
    window = mirrors.corners[sequence[-1]] - latest[:, None]
    # Side planes of the beam through the window, their normals into the beam.
    sides = np.cross(window, np.roll(window, -1, axis=1))
    facing = np.sign(-mirrors.heights(latest, sequence[-1]))
    sides *= facing[:, None, None]
    # In front of the window, as seen from the image, and within every side plane.
    normal: np.ndarray = facing[:, None] * mirrors.normals[sequence[-1]]
    corners = mirrors.corners.reshape(-1, 3)
    depth = dot(corners[None] - mirrors.corners[sequence[-1], 0], normal[:, None])
    inside = dot(sides[:, None], (corners[None] - latest[:, None])[:, :, None])
    shape = (len(latest), len(mirrors), 4)
    in_front = (depth > ON_PLANE).reshape(shape).any(axis=-1)
    within = (inside >= 0.0).reshape(*shape, 4).any(axis=2).all(axis=-1)
    reach: np.ndarray = np.any(reflects & in_front & within, axis=0)
    reach[sequence[-1]] = False
    return reach


def _trace(
    mirrors: Mirrors,
    sequence: tuple[int, ...],
    images: _Images,
    sources: Float[np.ndarray, "sources 3"],
    receivers: Float[np.ndarray, "receivers 3"],
    ends: Float[np.ndarray, "receivers 3"],
    blocked: Blocked,
    clearance: float,
    *,
    paired: bool = False,
    slabs: Slabs | None = None,
) -> Chain:
    pairs = np.zeros(len(sources) * (1 if paired else len(receivers)), dtype=bool)
    parts = [np.empty((0, len(sequence), 3))]
    sets = [np.empty((0, len(sequence) + 1), dtype=np.int64)]
    for first in range(0, pairs.size, PAIRS_AT_ONCE):
        some = np.arange(first, min(first + PAIRS_AT_ONCE, pairs.size))
        source, receiver = (some, some) if paired else np.divmod(some, len(receivers))
        kept, vertices = _unfold(mirrors, sequence, images, sources, receivers, source, receiver)
        source, receiver = source[kept], receiver[kept]
        points = [sources[source], *np.moveaxis(vertices, 1, 0), ends[receiver]]
        lifted = _lifted(mirrors, sequence, points, clearance)
        clear = _clear(lifted, blocked)
        pairs[some[kept[clear]]] = True
        if slabs is not None and len(slabs):
            legs = [slabs.crossed(a[clear], b[clear]) for a, b in pairwise(lifted)]
            sets.append(np.stack(legs, axis=-1))
        parts.append(vertices[clear])
    valid = np.diag(pairs) if paired else pairs.reshape(len(sources), len(receivers))
    source, receiver = np.nonzero(valid)
    last = images[-1] if sequence else sources
    unfolded = receivers[receiver] - last[source]
    lengths = np.linalg.norm(unfolded, axis=-1)
    directions, cosines = folded_back(mirrors, sequence, unfolded / lengths[:, None])
    return Chain(
        mirrors=sequence,
        valid=valid,
        lengths=lengths,
        vertices=np.concatenate(parts),
        cosines=cosines,
        directions=directions,
        crossed=np.concatenate(sets) if slabs is not None and len(slabs) else None,
    )


def _unfold(
    mirrors: Mirrors,
    sequence: tuple[int, ...],
    images: _Images,
    sources: Float[np.ndarray, "sources 3"],
    receivers: Float[np.ndarray, "receivers 3"],
    source: Int[np.ndarray, " pairs"],
    receiver: Int[np.ndarray, " pairs"],
) -> tuple[Int[np.ndarray, " paths"], Float[np.ndarray, "paths bounces 3"]]:
    """Return the points of reflection, by folding the line from the last image to the receiver.

    Returns the indices of the pairs that have a path within the mirrors' extents and on their
    reflecting sides, and its vertices.
    """
    kept = np.arange(len(source))
    points = receivers[receiver]
    last = images[-1] if sequence else sources
    apart = np.linalg.norm(points - last[source], axis=-1) > ON_PLANE
    kept, points = kept[apart], points[apart]
    vertices = np.empty((len(kept), len(sequence), 3))
    for bounce in reversed(range(len(sequence))):
        mirror = sequence[bounce]
        image = images[bounce][source[kept]]
        here, behind = mirrors.heights(points, mirror), mirrors.heights(image, mirror)
        apart = (here * behind < 0) & (np.minimum(np.abs(here), np.abs(behind)) > ON_PLANE)
        if not mirrors.two_sided[mirror]:
            apart &= here > 0
        kept, points, image = kept[apart], points[apart], image[apart]
        fraction = here[apart] / (here[apart] - behind[apart])
        hits = points + fraction[:, None] * (image - points)
        inside = mirrors.reflects_at(hits, mirror)
        kept, points = kept[inside], hits[inside]
        vertices = vertices[apart][inside]
        vertices[:, bounce] = points
    return kept, vertices


def _lifted(
    mirrors: Mirrors,
    sequence: tuple[int, ...],
    points: list[Float[np.ndarray, "paths 3"]],
    clearance: float,
) -> list[Float[np.ndarray, "paths 3"]]:
    """Move the vertices of paths off their mirrors."""
    lifted = [points[0]]
    for mirror, before, here in zip(sequence, points[:-1], points[1:], strict=False):
        side = np.sign(mirrors.heights(before, mirror))
        lift = clearance + ROUGHNESS_CLEARANCE * mirrors.rms_heights[mirror]
        lifted.append(here + lift * side[:, None] * mirrors.normals[mirror])
    lifted.append(points[-1])
    return lifted


def _clear(
    lifted: list[Float[np.ndarray, "paths 3"]], blocked: Blocked
) -> Int[np.ndarray, " clear"]:
    """Return the indices of the paths that are not blocked between their points."""
    clear = np.arange(len(lifted[0]))
    for start, end in pairwise(lifted):
        if clear.size:
            clear = clear[~blocked(start[clear], end[clear])]
    return clear
