"""Triangle meshes in memory: areas, normals, the edges that two triangles share, closedness."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

SMALLEST_HEIGHT = 1e-8
"""Height of a triangle below which it is none, and distance below which vertices are one: what
is left of 1 after rounding to single precision, a tenth. [unit of the file]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class TriangleMesh:
    """A triangle mesh; its triangles' normals follow their corners counter-clockwise."""

    vertices: Float[np.ndarray, "vertices 3"]  # [m]
    faces: Int[np.ndarray, "faces 3"]

    @cached_property
    def triangles(self) -> Float[np.ndarray, "faces 3 3"]:
        """Corners of each triangle [m]."""
        corners: np.ndarray = self.vertices[self.faces]
        return corners

    @cached_property
    def areas(self) -> Float[np.ndarray, " faces"]:
        """Area of each triangle [m²]."""
        twice: np.ndarray = np.linalg.norm(self._crosses, axis=-1)
        return twice / 2

    @cached_property
    def normals(self) -> Float[np.ndarray, "faces 3"]:
        """Unit normal of each triangle."""
        units: np.ndarray = self._crosses / (2 * self.areas[:, None])
        return units

    @cached_property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lowest and highest corner of the bounding box [m]."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def area(self) -> float:
        """Area of the surface [m²]."""
        return float(self.areas.sum())

    @property
    def volume(self) -> float:
        """Volume within a closed mesh, negative if its normals point inward [m³]."""
        middle = self.bounds.mean(axis=0)  # far from the origin, rounding would count
        a, b, c = np.moveaxis(self.triangles - middle, 1, 0)
        return float(np.einsum("fx,fx->f", a, np.cross(b, c)).sum() / 6)

    @cached_property
    def is_watertight(self) -> bool:
        """Whether each edge belongs to exactly two triangles."""
        _, counts, _ = self._edges
        return bool(np.all(counts == 2))

    @cached_property
    def open_edges(self) -> int:
        """Number of edges that belong to one triangle, or to more than two."""
        _, counts, _ = self._edges
        return int(np.count_nonzero(counts != 2))

    @cached_property
    def neighbours(self) -> Int[np.ndarray, "pairs 2"]:
        """Pairs of triangles that share an edge which belongs to no third one."""
        order, counts, _ = self._edges
        return _pairs(order, counts) // 3

    @cached_property
    def against(self) -> Bool[np.ndarray, " pairs"]:
        """Whether each pair of neighbours is wound oppositely: both run along their edge alike."""
        order, counts, forward = self._edges
        pairs = _pairs(order, counts)
        return np.asarray(forward[pairs[:, 0]] == forward[pairs[:, 1]])

    @cached_property
    def _crosses(self) -> Float[np.ndarray, "faces 3"]:
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        across: np.ndarray = np.cross(b - a, c - a)
        return across

    @cached_property
    def _edges(
        self,
    ) -> tuple[Int[np.ndarray, " edges"], Int[np.ndarray, " unique"], Bool[np.ndarray, " edges"]]:
        """Edges (three to a triangle) sorted so that equal ones stand together.

        Returns their numbers in that order, how many are equal each time, and whether each
        edge, by its number, runs from its lower vertex to its higher one.
        """
        ends = self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        low, high = ends.min(axis=1), ends.max(axis=1)
        keys = low * np.int64(len(self.vertices)) + high
        order = np.argsort(keys, kind="stable")
        _, counts = np.unique(keys[order], return_counts=True)
        return order, counts, np.asarray(ends[:, 0] == low)


def _pairs(
    order: Int[np.ndarray, " edges"], counts: Int[np.ndarray, " unique"]
) -> Int[np.ndarray, "pairs 2"]:
    first = (np.cumsum(counts) - counts)[counts == 2]
    return np.stack([order[first], order[first + 1]], axis=-1)


def cleaned(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"]
) -> TriangleMesh:
    """Merge coincident vertices; drop degenerate triangles, and vertices that no triangle uses.

    The order of what stays is kept.
    """
    vertices, number = _joined(vertices)
    faces = number[faces]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    across = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
    longest = np.max([np.linalg.norm(side, axis=-1) for side in (b - a, c - b, a - c)], axis=0)
    faces = faces[across > SMALLEST_HEIGHT * longest]
    used, corners = np.unique(faces, return_inverse=True)
    return TriangleMesh(vertices=vertices[used], faces=corners.reshape(-1, 3).astype(np.int64))


def _joined(
    vertices: Float[np.ndarray, "vertices 3"],
) -> tuple[Float[np.ndarray, "fewer 3"], Int[np.ndarray, " vertices"]]:
    places = np.round(vertices / SMALLEST_HEIGHT)
    order = np.lexsort(places.T)  # stable: of equal ones, the first stays first
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = (np.diff(places[order], axis=0) != 0).any(axis=1)
    first = order[begins]
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    number = np.empty(len(order), dtype=np.int64)
    number[order] = rank[np.cumsum(begins) - 1]
    return vertices[np.sort(first)], number


def distances_to_triangles(
    point: Float[np.ndarray, " 3"], triangles: Float[np.ndarray, "faces 3 3"]
) -> Float[np.ndarray, " faces"]:
    """Distance from a point to each triangle: to its plane, or to the nearest of its edges [m]."""
    offsets = point - triangles
    sides = np.roll(triangles, -1, axis=1) - triangles
    normals = np.cross(sides[:, 0], sides[:, 1])
    within = np.einsum("fcx,fx->fc", np.cross(sides, offsets), normals)
    share = np.einsum("fcx,fcx->fc", offsets, sides) / np.einsum("fcx,fcx->fc", sides, sides)
    beyond = offsets - np.clip(share, 0.0, 1.0)[..., None] * sides
    to_edges = np.linalg.norm(beyond, axis=-1).min(axis=-1)
    height = np.abs(np.einsum("fx,fx->f", offsets[:, 0], normals))
    to_plane = height / np.linalg.norm(normals, axis=-1)
    nearest: np.ndarray = np.where((within >= 0.0).all(axis=-1), to_plane, to_edges)
    return nearest
