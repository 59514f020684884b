"""Convex polygons, one for each link: cut by planes, and seen through one another.

All of them have as many corners: where there are fewer, the last is repeated; where nothing is
left, all corners are one.
"""

import numpy as np
from jaxtyping import Bool, Float

Polygons = Float[np.ndarray, "links _ 3"]
"""Corners in order around, for each link. [m]"""

NARROWEST = 1e-9
"""Distance of a corner from a source's own height, over that height, below which it is not seen:
the polygon ends there. [-]"""


def clipped(
    polygons: Float[np.ndarray, "links corners 3"], heights: Float[np.ndarray, "links corners"]
) -> Polygons:
    """Keep the part of polygons that lies above a plane (Sutherland and Hodgman, 1974).

    Parameters
    ----------
    polygons
        Convex. [m]
    heights
        Of their corners over the plane. [m]

    Returns
    -------
    With one corner more, at most.
    """
    after, heights_after = np.roll(polygons, -1, axis=1), np.roll(heights, -1, axis=1)
    kept = heights >= 0
    crossing = kept != (heights_after >= 0)
    share = np.divide(heights, heights - heights_after, out=np.zeros_like(heights), where=crossing)
    cuts = polygons + share[..., None] * (after - polygons)
    links, count = heights.shape
    places = np.stack([polygons, cuts], axis=2).reshape(links, 2 * count, 3)
    valid = np.stack([kept, crossing], axis=2).reshape(links, 2 * count)
    found = np.minimum(valid.sum(axis=1), count + 1)
    count = max(1, int(found.max(initial=1))) - 1
    order = np.argsort(~valid, axis=1, kind="stable")[:, : count + 1]
    # What is missing repeats the last corner there is.
    order = np.take_along_axis(
        order, np.minimum(np.arange(count + 1), np.maximum(found - 1, 0)[:, None]), axis=1
    )
    return np.take_along_axis(places, order[..., None], axis=1)


def empty(polygons: Polygons) -> Bool[np.ndarray, " links"]:
    """Tell which polygons have no area to speak of."""
    spokes = polygons - polygons[:, :1]
    doubled = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    size = np.einsum("lcx,lcx->lc", spokes, spokes).max(axis=1)
    return np.asarray(np.einsum("lx,lx->l", doubled, doubled) <= (1e-9 * size) ** 2)


def within_view(
    polygons: Polygons,
    eyes: Float[np.ndarray, "links 3"],
    windows: Polygons,
    normal: Float[np.ndarray, " 3"],
) -> Polygons:
    """Keep the part of flat polygons that is seen through windows.

    Parameters
    ----------
    polygons
        All in one plane. [m]
    eyes
        From where they are looked at, one for each. [m]
    windows
        Flat and convex; only what of them lies between eye and plane is one. [m]
    normal
        Of the polygons' plane, a unit vector.
    """
    height = np.einsum("lx,x->l", eyes - polygons[:, 0], normal)
    normal = normal * np.sign(height)[:, None]  # towards the eyes
    height = np.abs(height)
    over = np.einsum("lcx,lx->lc", windows - polygons[:, :1], normal)
    windows = clipped(windows, over)
    over = np.einsum("lcx,lx->lc", windows - polygons[:, :1], normal)
    windows = clipped(windows, (1 - NARROWEST) * height[:, None] - over)
    spokes = windows - windows[:, :1]
    doubled = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    middle = windows.mean(axis=1) - eyes
    sense = np.sign(np.einsum("lx,lx->l", doubled, middle))
    left = polygons
    for edge in range(windows.shape[1]):
        one, other = windows[:, edge] - eyes, windows[:, (edge + 1) % windows.shape[1]] - eyes
        inward = np.cross(one, other) * sense[:, None]
        depth = np.einsum("lcx,lx->lc", left - eyes[:, None], inward)
        # Repeated corners make no edge.
        flat = np.einsum("lx,lx->l", inward, inward) == 0
        left = clipped(left, np.where(flat[:, None], 1.0, depth))
    return np.where(empty(windows)[:, None, None], left[:, :1], left)
