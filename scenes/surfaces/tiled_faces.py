"""Flat faces, cut into facets only inside antenna beams; large cells elsewhere only block rays."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from scenes.surfaces.facet_spacing import steps

TILE = 0.05
"""Side of the squares that are cut into facets as a whole, or not at all. [m]"""

Reach = Callable[[Float[np.ndarray, "tiles 3"], float], Bool[np.ndarray, " tiles"]]
"""Tells which spheres of one radius, by their centres, an antenna's pattern reaches. [m]"""


@dataclass(frozen=True, kw_only=True)
class Face:
    """A rectangle in space; its normal is first x second direction."""

    corner: Float[np.ndarray, " 3"]  # [m]
    first: Float[np.ndarray, " 3"]  # its whole side [m]
    second: Float[np.ndarray, " 3"]  # [m]


@dataclass(frozen=True, kw_only=True)
class TiledFace:
    """Vertices of a face, its facets, and the large triangles outside all antenna beams."""

    vertices: Float[np.ndarray, "vertices 3"]  # [m]
    mean_vertices: Float[np.ndarray, "vertices 3"]  # [m]
    cells: Int[np.ndarray, "cells 3"]
    screens: Int[np.ndarray, "screens 3"]


def tiled_face(
    face: Face,
    spacing: float,
    reach: Reach,
    heights: Callable[[tuple[float, float], tuple[int, int]], Float[np.ndarray, "first second"]],
) -> TiledFace:
    """Cut a face into facets where it is in reach.

    Parameters
    ----------
    face
        The rectangle.
    spacing
        Largest distance of neighbouring vertices along both its sides. [m]
    reach
        Where facets are needed.
    heights
        Draws the heights over the whole face from its sides [m] and its numbers of vertices:
        they do not depend on what is in reach. [m]
    """
    sides = tuple(float(np.linalg.norm(side)) for side in (face.first, face.second))
    counts = tuple(steps(side, spacing) for side in sides)
    each = tuple(
        max(1, int(TILE / (side / count))) for side, count in zip(sides, counts, strict=True)
    )
    edges = [
        np.append(np.arange(0, count, width), count)
        for count, width in zip(counts, each, strict=True)
    ]
    centres = [
        (edge[:-1] + edge[1:]) / (2 * count) for edge, count in zip(edges, counts, strict=True)
    ]
    places = (
        face.corner
        + centres[0][:, None, None] * face.first
        + centres[1][None, :, None] * face.second
    )
    radius = 0.5 * (
        math.hypot(
            *(side / count * width for side, count, width in zip(sides, counts, each, strict=True))
        )
    )
    wanted = reach(places.reshape(-1, 3), radius).reshape(places.shape[:2])
    used = np.zeros((counts[0] + 1, counts[1] + 1), dtype=bool)
    used[np.ix_(*edges)] = True
    cells = np.repeat(np.repeat(wanted, np.diff(edges[0]), axis=0), np.diff(edges[1]), axis=1)
    for i in (slice(0, -1), slice(1, None)):
        for j in (slice(0, -1), slice(1, None)):
            used[i, j] |= cells
    ids = np.cumsum(used.ravel()).reshape(used.shape) - 1
    first, second = np.nonzero(used)
    mean = (
        face.corner
        + (first / counts[0])[:, None] * face.first
        + (second / counts[1])[:, None] * face.second
    )
    normal = np.cross(face.first, face.second)
    normal /= np.linalg.norm(normal)
    height = heights((sides[0], sides[1]), (counts[0] + 1, counts[1] + 1))[used]
    return TiledFace(
        vertices=mean + height[:, None] * normal,
        mean_vertices=mean,
        cells=_triangles(ids, cells),
        screens=_triangles(ids[np.ix_(*edges)], ~wanted),
    )


def _triangles(
    ids: Int[np.ndarray, "first second"], chosen: Bool[np.ndarray, "cells_first cells_second"]
) -> Int[np.ndarray, "triangles 3"]:
    """Two triangles for each chosen cell of a grid, as :func:`upright_shapes.grid_triangles`."""
    a, b, c, d = (part[chosen] for part in (ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]))
    return np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
