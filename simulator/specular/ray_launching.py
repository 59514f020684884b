"""Candidate sequences of mirrors by launching rays, where there are too many to try all.

A room has six walls and some hundred sequences of three; a town has thousands of walls. Rays are
launched from the antennas evenly in all directions, and the sequences of mirrors that they meet
are the candidates; the image method then decides, in double precision, which are paths. At a
transmitting face, half of the rays continue straight. Faces that no ray meets are missed: those
narrower than about :data:`RAY_SPACING` times their unfolded distance.
"""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from jaxtyping import Bool, Float, Int

from scenes.realisations.object_surface import Surface
from simulator.antennas.beam_culling import LEVEL, AntennaGroup
from simulator.geometry.mirrors import Mirrors, dot
from simulator.geometry.ray_scene import RayScene, build_scene

RAYS = 2**20
"""Rays that are launched from each antenna position. [-]"""

RAY_SPACING = (4 * np.pi / RAYS) ** 0.5
"""Angle between neighbouring rays: 3.5 mrad. [rad]"""

MOST_PASSED = 4
"""Most transmissions of a ray, in addition to its reflections. [-]"""

MOST_TRIED = 20_000
"""Most sequences that are all tried, without launching rays: some seconds. [-]"""


def likely_sequences(
    mirrors: Mirrors,
    group: AntennaGroup,
    most: int,
    *,
    passing: Bool[np.ndarray, " mirrors"] | None = None,
) -> tuple[tuple[int, ...], ...] | None:
    """Return :func:`launched_sequences` of one group; None if few enough sequences to try all."""
    if len(mirrors) ** max(most, 0) <= MOST_TRIED:
        return None
    return launched_sequences(mirrors, [group], most, passing=passing)


def launched_sequences(
    mirrors: Mirrors,
    groups: Sequence[AntennaGroup],
    most: int,
    *,
    passing: Bool[np.ndarray, " mirrors"] | None = None,
) -> tuple[tuple[int, ...], ...]:
    """Find the sequences of 1 to ``most`` mirrors that rays from antennas meet.

    Parameters
    ----------
    mirrors
        All mirrors of the scene.
    groups
        Antennas; rays are launched from the first, the middle and the last of each group.
    most
        Most mirrors of a sequence.
    passing
        Which mirrors transmit waves; None: none does.

    Returns
    -------
    In the order of their mirrors, each sequence before those that extend it.
    """
    if len(mirrors) == 0 or most < 1:
        return ()
    through = np.zeros(len(mirrors), dtype=bool) if passing is None else passing
    rays = _scene_of(mirrors)
    found: set[tuple[int, ...]] = set()
    for group in groups:
        places = group.positions
        picks = np.unique([0, (len(places) - 1) // 2, len(places) - 1])
        for place in places[picks]:
            directions = _even_directions()
            field = group.pattern.towards(directions)
            directions = directions[np.abs(field) >= LEVEL * group.pattern.peak]
            found |= _followed(mirrors, rays, through, place, directions, most)
    return tuple(sorted(found))


def _scene_of(mirrors: Mirrors) -> RayScene:
    first = 4 * np.arange(len(mirrors))[:, None, None]
    cells = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    corners = mirrors.corners.reshape(-1, 3)
    surface = Surface(
        name="mirrors",
        material="metal",
        vertices=corners,
        mean_vertices=corners,
        cells=cells,
        closed=False,
    )
    return build_scene([surface])


def _even_directions() -> Float[np.ndarray, "rays 3"]:
    """Spread directions evenly over the sphere, on a spiral of the golden angle."""
    index = np.arange(RAYS) + 0.5
    height = 1 - 2 * index / RAYS
    turn = np.pi * (3 - np.sqrt(5)) * index
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=-1)


def _followed(
    mirrors: Mirrors,
    rays: RayScene,
    through: Bool[np.ndarray, " mirrors"],
    place: Float[np.ndarray, " 3"],
    directions: Float[np.ndarray, "rays 3"],
    most: int,
) -> set[tuple[int, ...]]:
    """Follow rays from one place; return the sequences of mirrors that reflect them."""
    rng = np.random.default_rng(0)  # which rays go through slabs: the same each time
    origins = np.tile(place, (len(directions), 1))
    met = np.full((len(directions), most), -1)
    count = np.zeros(len(directions), dtype=np.int64)
    found: set[tuple[int, ...]] = set()
    for _ in range(most + MOST_PASSED * bool(through.any())):
        if not len(origins):
            break
        hit, distance = _intersected(rays, origins, directions)
        some = np.flatnonzero(hit >= 0)
        origins, directions, met, count = origins[some], directions[some], met[some], count[some]
        hit, distance = hit[some], distance[some]
        normals = mirrors.normals[hit]
        against = dot(directions, normals)
        points = origins + distance[:, None] * directions
        goes_on = through[hit] & (rng.random(len(hit)) < 0.5)
        reflected = ~goes_on & (mirrors.two_sided[hit] | (against < 0))
        met[reflected, count[reflected]] = hit[reflected]
        count += reflected
        for row in np.unique(met[reflected], axis=0).tolist():
            found.add(tuple(mirror for mirror in row if mirror >= 0))
        side = np.where(reflected, -np.sign(against), np.sign(against))
        directions = np.where(
            reflected[:, None], directions - 2 * against[:, None] * normals, directions
        )
        origins = points + rays.clearance * side[:, None] * normals
        alive = (reflected & (count < most)) | goes_on
        origins, directions, met, count = (v[alive] for v in (origins, directions, met, count))
    return found


def _intersected(
    rays: RayScene, origins: Float[np.ndarray, "rays 3"], directions: Float[np.ndarray, "rays 3"]
) -> tuple[Int[np.ndarray, " rays"], Float[np.ndarray, " rays"]]:
    """Return which mirror each ray meets first, -1: none, and how far away. [m]."""
    starts = rays.about_centre(origins)
    ray: Any = mi.Ray3f(_single(starts, mi.Point3f), _single(directions, mi.Vector3f))
    met = rays.scene.mi_scene.ray_intersect_preliminary(ray)
    valid, triangle, distance = met.is_valid(), met.prim_index, met.t
    dr.eval(valid, triangle, distance)  # while the scene lives
    mirror = np.asarray(triangle.numpy(), dtype=np.int64) // 2
    return np.where(valid.numpy(), mirror, -1), np.asarray(distance.numpy(), dtype=np.float64)


def _single(values: Float[np.ndarray, "rays 3"], kind: Any) -> Any:
    return kind(*(mi.Float(values[:, axis].astype(np.float32)) for axis in range(3)))
