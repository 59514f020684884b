"""The shape of a surface as points with their neighbours: lines in 2-D, triangles in 3-D."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Vertices and cells of one object."""

    vertices: Float[np.ndarray, "vertices 3"]  # displaced by the roughness [m]
    mean_vertices: Float[np.ndarray, "vertices 3"]  # of the smooth shape [m]
    cells: Int[np.ndarray, "cells corners"]  # outward, or to the side of the plate's normal
    screens: Int[np.ndarray, "screens 3"] = field(
        default_factory=lambda: np.empty((0, 3), dtype=np.int64)
    )  # triangles outside all antenna beams: they only block rays


def grid_triangles(
    ids: Int[np.ndarray, "first second"],
) -> Int[np.ndarray, "triangles 3"]:
    """Cut a grid of vertices into triangles; their normals are first x second direction."""
    a, b, c, d = (part.ravel() for part in (ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]))
    return np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
