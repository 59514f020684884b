"""Which chains of plane walls a ray from a planar array can follow at all.

A chain's mirrors appear, each as an image, behind one another. Rays through all of them form a
convex beam with its apex at the array; the next mirror's image is clipped to it, and to what is
behind the mirror before, as in beam tracing.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from estimator.geometry.specular_chains import LONGEST_CHAIN, Chain, image_over
from estimator.geometry.wall_3d import PlaneWall

EDGE_ON = 1e-9
"""Sine of the angle at which a polygon seen from the array has no area left. [-]"""


def possible_chains(
    walls: Sequence[PlaneWall], *, deepest: int = LONGEST_CHAIN, reach: float = np.inf
) -> Iterator[Chain]:
    """Go through the chains that some ray from the array could follow; the empty one first.

    What stands between is not looked at.

    Parameters
    ----------
    walls
        All mirrors, at their true place.
    deepest
        Most mirrors of a chain.
    reach
        Longest path that is of interest: a chain whose last mirror appears beyond is none. [m]
    """
    yield from _continued(walls, (), np.zeros((0, 3)), deepest, reach)


def _continued(
    walls: Sequence[PlaneWall],
    chain: Chain,
    beam: Float[np.ndarray, "sides 3"],
    deepest: int,
    reach: float,
) -> Iterator[Chain]:
    yield chain
    if len(chain) == deepest:
        return
    for index, wall in enumerate(walls):
        if chain and chain[-1] == index:
            continue
        image = image_over(wall.corners, walls, chain)
        for side in beam:
            image = _clipped(image, side, 0.0)
        if chain:
            last = image_over(walls[chain[-1]].corners, walls, chain[:-1])
            normal = np.cross(last[1] - last[0], last[2] - last[0])
            here = float(last[0] @ normal)
            image = _clipped(image, np.sign(here) * normal, abs(here))
        narrower = _beam_through(image)
        if narrower is not None and _plane_distance(image) <= reach:
            yield from _continued(walls, (*chain, index), narrower, deepest, reach)


def _clipped(
    polygon: Float[np.ndarray, "corners 3"], normal: Float[np.ndarray, " 3"], offset: float
) -> Float[np.ndarray, "kept 3"]:
    """Cut a convex polygon off where normal · p < offset (Sutherland and Hodgman, 1974)."""
    heights = polygon @ normal - offset
    kept = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if heights[i] >= 0:
            kept.append(polygon[i])
        if heights[i] * heights[j] < 0:
            share = heights[i] / (heights[i] - heights[j])
            kept.append(polygon[i] + share * (polygon[j] - polygon[i]))
    return np.array(kept).reshape(-1, 3)


def _beam_through(polygon: Float[np.ndarray, "corners 3"]) -> Float[np.ndarray, "sides 3"] | None:
    """Return the inward normals of the beam from the array through a polygon; None: no beam."""
    if len(polygon) < 3:
        return None
    middle = polygon.mean(axis=0)
    sides = np.cross(polygon, np.roll(polygon, -1, axis=0))
    sizes = np.linalg.norm(sides, axis=1)
    sides = sides[sizes > 0] / sizes[sizes > 0, None]
    depths = sides @ middle
    if not sides.size or np.abs(depths).max() < EDGE_ON * np.linalg.norm(middle):
        return None
    inward: np.ndarray = sides * np.sign(depths[np.argmax(np.abs(depths))])
    return inward


def _plane_distance(polygon: Float[np.ndarray, "corners 3"]) -> float:
    """Distance of a polygon's plane from the array: no part of it is nearer. [m]."""
    normals = np.cross(polygon - polygon[0], np.roll(polygon, -1, axis=0) - polygon[0])
    normal = normals[int(np.argmax(np.linalg.norm(normals, axis=1)))]
    size = float(np.linalg.norm(normal))
    return abs(float(polygon[0] @ normal)) / size if size > 0 else 0.0
