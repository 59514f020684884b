"""Polygons as mesh files list them, and the triangles that they are cut into."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, eq=False, kw_only=True)
class Polygons:
    """Vertices, and polygons one after the other."""

    vertices: Float[np.ndarray, "vertices 3"]  # [unit of the file]
    corners: Int[np.ndarray, " corners"]  # vertices of the first polygon, of the second …
    counts: Int[np.ndarray, " polygons"]  # how many corners each has


def triangles_of(polygons: Polygons) -> Int[np.ndarray, "faces 3"]:
    """Cut polygons into fans of triangles that all have the polygon's first corner.

    Raises
    ------
    ValueError
        If a polygon refers to a vertex that does not exist.
    """
    corners, counts, known = polygons.corners, polygons.counts, len(polygons.vertices)
    wrong = (corners < 0) | (corners >= known)
    if wrong.any():
        raise ValueError(f"a face has vertex {corners[wrong][0]}, and there are {known}")
    starts, pieces = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    first = np.repeat(starts, pieces)
    step = np.arange(len(first)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=-1)
