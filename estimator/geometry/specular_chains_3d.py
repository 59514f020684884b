"""Chains of plane mirrors in space: over which of them the array sees a point of its image.

The raw image shows everything on the straight line that its wave seems to come along. Followed
from the array and folded at each wall that it meets, that line ends where the thing really is.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise, product

import numpy as np
from jaxtyping import Bool, Float, Int

from estimator.geometry.path_tracing_3d import GRAZING, folded_over
from estimator.geometry.wall_3d import PlaneWall, within

Chain = tuple[int, ...]
"""Indices of walls, from the array outward."""


def unfolded_in_space(
    points: Float[np.ndarray, "n 3"],
    walls: Sequence[PlaneWall],
    *,
    deepest: int,
    skin: float = 0.0,
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "n deepest"]]:
    """Follow the straight lines to points of the raw image, and fold them at each wall.

    Parameters
    ----------
    points
        In the frame of an array at the origin. [m]
    walls
        All mirrors, at their true place.
    deepest
        Most walls on the way.
    skin
        How far behind a wall a line must go on to be folded there: what is less far is the wall's
        own image. [m]

    Returns
    -------
    Where the lines end [m], and the walls on the way of each; -1 where there are no more.
    """
    places = np.zeros_like(points)
    left = np.linalg.norm(points, axis=1)
    directions = points / np.maximum(left, 1e-300)[:, None]
    chains = np.full((len(points), deepest), -1)
    going = np.flatnonzero(left > 0) if walls else np.zeros(0, dtype=np.int64)
    for bounce in range(deepest):
        if not going.size:
            break
        distance, met = _next_walls(
            places[going],
            directions[going],
            left[going],
            walls,
            skin,
            before=chains[going, bounce - 1] if bounce else np.full(going.size, -1),
        )
        hit = met >= 0
        going, met, distance = going[hit], met[hit], distance[hit]
        chains[going, bounce] = met
        places[going] += distance[:, None] * directions[going]
        left[going] -= distance
        normals = np.array([wall.normal for wall in walls])[met]
        across = np.einsum("nx,nx->n", directions[going], normals)
        directions[going] -= 2 * across[:, None] * normals
    return places + left[:, None] * directions, chains


def _next_walls(
    places: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "n 3"],
    left: Float[np.ndarray, " n"],
    walls: Sequence[PlaneWall],
    skin: float,
    *,
    before: Int[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Return the wall that each line meets next, and how far away; -1 without one."""
    nearest, met = left.copy(), np.full(len(places), -1)
    for index, wall in enumerate(walls):
        slope = directions @ wall.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = ((wall.centre - places) @ wall.normal) / slope
        ahead = (distance > GRAZING) & (distance < nearest) & (before != index)
        ahead &= (left - distance) * np.abs(slope) > skin
        chosen = np.flatnonzero(ahead)
        crossing = places[chosen] + distance[chosen, None] * directions[chosen]
        chosen = chosen[within(crossing, wall)]
        nearest[chosen], met[chosen] = distance[chosen], index
    return nearest, met


def seen_over_in_space(
    images: Float[np.ndarray, "n 3"], walls: Sequence[PlaneWall], chain: Chain, *, skin: float
) -> Bool[np.ndarray, " n"]:
    """Tell which points of the raw image are seen over exactly this chain.

    Parameters
    ----------
    images, walls, skin
        As in :func:`unfolded_in_space`.
    chain
        Of at least one wall.
    """
    first = walls[chain[0]]
    # Most points are not behind the first wall: they need not be followed.
    side = float(np.sign(first.centre @ first.normal))
    seen: np.ndarray = side * ((images - first.centre) @ first.normal) > 0
    chains = unfolded_in_space(images[seen], walls, deepest=len(chain) + 1, skin=skin)[1]
    seen[seen] = np.all(chains == [*chain, -1], axis=1)
    return seen


def image_in_space(
    points: Float[np.ndarray, "*n 3"], walls: Sequence[PlaneWall], chain: Chain
) -> Float[np.ndarray, "*n 3"]:
    """Return where the raw image shows points that are seen over a chain. [m]."""
    return folded_over(points, walls, chain[::-1])  # mirroring undoes itself


def chains_in_space(walls: int, *, deepest: int) -> Iterator[Chain]:
    """Yield all chains of one wall or more; none repeats a wall at once."""
    for length in range(1, deepest + 1):
        for chain in product(range(walls), repeat=length):
            if all(one != other for one, other in pairwise(chain)):
                yield chain
