"""Visibility of facets from antennas in 3-D: by shafts if nothing is between, else by rays.

A shaft is the convex hull of all antennas and of a tile of facets (E. A. Haines and J. R. Wallace,
"Shaft culling for efficient ray-cast radiosity", 1994, doi:10.1007/978-3-642-57963-9_10). If planes
separate it from every other object, and the object's own facets all face the antennas, they are
visible, and no ray is traced. A surface does not hide itself by its own roughness: rays meet mean
surfaces, and a convex one hides none of its facets that face the antennas.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from scenes.scenario import Scenario
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate
from scenes.surfaces.facet_spacing import FEWEST_ROUND
from simulator.geometry.facets import Facets
from simulator.geometry.mean_surfaces import mean_surfaces, rms_height
from simulator.geometry.patches import cut_into_patches
from simulator.geometry.ray_scene import RayScene, facets_visible
from simulator.visibility.seen import Seen

TILE = 0.05
"""Side of the tiles; each is tested by one shaft. [m]"""

MARGIN = 6.0
"""Bound of an object's excursions from its mean shape, in rms heights. [-]"""

GAP = 1e-5
"""Least distance between a shaft and an obstacle that counts as separated: above rounding. [m]"""

PARALLEL = 1e-6
"""Angle between a shaft and an edge below which they count as parallel, and span no separating
plane: none is tried, and rays are traced. [rad]"""

RAYS_AT_ONCE = 2**26
"""Rays whose results are held at one time: 64 MiB. [-]"""

MOST_FACES = 64
"""Most faces of a mesh whose faces are separate obstacles; beyond, its bounding box is one. [-]"""


Shape = Literal["convex", "any"]
"""Convex: the object hides none of its own facets that face the antennas."""


@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """A convex body that may block: the hull of its corners, and its faces' normals."""

    owner: int  # the object it belongs to
    corners: Float[np.ndarray, "corners 3"]  # [m]
    axes: Float[np.ndarray, "axes 3"]  # unit vectors: normals of its faces
    edges: Float[np.ndarray, "edges 3"]  # unit vectors along its edges
    margin: float  # bound of its roughness beyond the hull [m]


def scenario_obstacles(scenario: Scenario) -> tuple[Obstacle, ...]:
    """Return the objects of a scenario, each as one or more convex bodies."""
    found = []
    for owner, surface in enumerate(mean_surfaces(scenario)):
        body = scenario.objects[surface.name]
        margin = GAP + MARGIN * rms_height(scenario, surface.name)
        points = surface.vertices
        if isinstance(body, MeshFile) and len(surface.cells) <= MOST_FACES:
            for cell in surface.cells:
                found.append(_triangle(owner, points[cell], margin))
            continue
        frame = np.eye(3)
        if isinstance(body, Plate | Box):
            frame = np.stack([body.tangent, body.across, [0.0, 0.0, 1.0]])
        along = np.einsum("px,ax->pa", points, frame)
        if isinstance(body, Cylinder):  # the mesh has chords, inside the circle
            margin += body.radius_m * (1 - math.cos(math.pi / FEWEST_ROUND))
        low, high = along.min(axis=0), along.max(axis=0)
        mask = np.array(np.meshgrid(*[[0, 1]] * 3, indexing="ij")).reshape(3, -1).T
        found.append(
            Obstacle(
                owner=owner,
                corners=np.einsum("ca,ax->cx", np.where(mask == 1, high, low), frame),
                axes=frame,
                edges=frame,
                margin=margin,
            )
        )
    return tuple(found)


def object_shape(scenario: Scenario, name: str) -> Shape:
    """Return whether an object may hide facets of its own that face the antennas."""
    return "any" if isinstance(scenario.objects[name], MeshFile) else "convex"


def _triangle(owner: int, corners: Float[np.ndarray, "3 3"], margin: float) -> Obstacle:
    edges = np.roll(corners, -1, axis=0) - corners
    edges /= np.linalg.norm(edges, axis=-1, keepdims=True)
    normal = np.cross(edges[0], edges[1])
    normal /= np.linalg.norm(normal)
    return Obstacle(
        owner=owner,
        corners=corners,
        axes=np.concatenate([normal[None], np.cross(normal, edges)]),
        edges=edges,
        margin=margin,
    )


def clear_shafts(
    antennas: Float[np.ndarray, "antennas 3"],
    centres: Float[np.ndarray, "tiles 3"],
    radii: Float[np.ndarray, " tiles"],
    obstacles: Sequence[Obstacle],
) -> Bool[np.ndarray, " tiles"]:
    """Return for which tiles no obstacle is between them and any antenna (conservative).

    Parameters
    ----------
    antennas
        [m]
    centres, radii
        Spheres around the tiles. [m]
    obstacles
        Bodies that may block.
    """
    clear = np.ones(len(centres), dtype=bool)
    middle = antennas.mean(axis=0)
    along = centres - middle
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    box = np.array(np.meshgrid(*zip(antennas.min(axis=0), antennas.max(axis=0), strict=True)))
    ends = antennas if len(antennas) < 8 else box.reshape(3, -1).T
    for obstacle in obstacles:
        left = np.flatnonzero(clear)
        if left.size == 0:
            break
        apart = np.zeros(left.size, dtype=bool)
        for axis in (*obstacle.axes, *np.eye(3)):
            apart |= _separated(np.broadcast_to(axis, (left.size, 3)), ends, centres[left],
                                radii[left], obstacle)  # fmt: skip
        for edge in (*obstacle.edges, *np.eye(3)):
            across = np.cross(along[left], edge)
            length = np.linalg.norm(across, axis=-1, keepdims=True)
            across = np.divide(across, length, out=np.zeros_like(across), where=length > PARALLEL)
            apart |= _separated(across, ends, centres[left], radii[left], obstacle)
        clear[left] = apart
    return clear


def _separated(
    axes: Float[np.ndarray, "tiles 3"],
    ends: Float[np.ndarray, "ends 3"],
    centres: Float[np.ndarray, "tiles 3"],
    radii: Float[np.ndarray, " tiles"],
    obstacle: Obstacle,
) -> Bool[np.ndarray, " tiles"]:
    """Return for which tiles a plane normal to an axis separates the shaft from the obstacle."""
    here = np.einsum("tx,ex->te", axes, ends)
    there = np.einsum("tx,tx->t", axes, centres)
    low = np.minimum(here.min(axis=1), there - radii)
    high = np.maximum(here.max(axis=1), there + radii)
    body = np.einsum("tx,cx->tc", axes, obstacle.corners)
    result: np.ndarray = (body.min(axis=1) - obstacle.margin > high) | (
        body.max(axis=1) + obstacle.margin < low
    )
    return result


@dataclass
class Sightlines:
    """Visibility of a scene's facets over links; called with a block of facets."""

    rays: RayScene
    facets: Facets
    senders: Float[np.ndarray, "senders 3"]  # as many as receivers, or a single one [m]
    receivers: Float[np.ndarray, "links 3"]  # [m]
    obstacles: Sequence[Obstacle]
    shapes: Sequence[Shape]  # of the object of each material of the facets
    objects: Sequence[int]  # index of that object
    traced: int = field(default=0, init=False)  # facets that rays were traced for

    def __call__(self, some: Int[np.ndarray, " some"]) -> Seen:
        """Return the visibility of some facets."""
        clear = np.zeros(len(some), dtype=bool)
        owners = (
            np.zeros(len(some), dtype=np.int64)
            if self.facets.material is None
            else self.facets.material[some]
        )
        for surface in np.unique(owners).tolist():
            mine = np.flatnonzero(owners == surface)
            if self.shapes[surface] != "any":
                clear[mine[self._clear(some[mine], surface)]] = True
        return self._trace(some, clear)

    def _clear(self, some: Int[np.ndarray, " some"], surface: int) -> Int[np.ndarray, " clear"]:
        """Return which of one object's facets are visible to all antennas by shafts."""
        tiles = cut_into_patches(self.facets.part(some), np.arange(len(some)), TILE)
        others = [one for one in self.obstacles if one.owner != self.objects[surface]]
        clear = np.ones(tiles.count, dtype=bool)
        for ends in self._ends():
            clear &= clear_shafts(ends, tiles.centres, tiles.radii, others)
        kept: np.ndarray = tiles.order[np.repeat(clear, np.diff(tiles.first))]
        return kept

    def _ends(self) -> list[Float[np.ndarray, "ends 3"]]:
        same = self.senders is self.receivers
        return [self.receivers] if same else [self.senders, self.receivers]

    def _trace(self, some: Int[np.ndarray, " some"], clear: Bool[np.ndarray, " some"]) -> Seen:
        """Trace rays from all antennas to the facets that are not clear."""
        count = len(self.receivers)
        always, sometimes, rows = clear.copy(), [], []
        unclear = np.flatnonzero(~clear)
        self.traced += unclear.size
        at_once = max(1, RAYS_AT_ONCE // count)
        for first in range(0, unclear.size, at_once):
            here = unclear[first : first + at_once]
            part = self.facets.part(some[here])
            seen = np.ones((count, here.size), dtype=bool)
            for ends in self._ends():
                seen &= facets_visible(self.rays, part, ends)
            everywhere, anywhere = seen.all(axis=0), seen.any(axis=0)
            always[here[everywhere]] = True
            mixed = anywhere & ~everywhere
            sometimes.append(here[mixed])
            rows.append(np.ascontiguousarray(seen[:, mixed].T))
        return Seen(
            always=always,
            sometimes=np.concatenate([np.empty(0, dtype=np.int64), *sometimes]),
            table=np.concatenate([np.empty((0, count), dtype=bool), *rows]),
        )
