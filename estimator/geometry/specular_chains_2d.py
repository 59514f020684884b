"""Chains of mirrors: which ones stand between the array and what its image shows.

In the image a ray from the array is straight. Whatever it shows behind a mirror is seen over it:
mirroring the rest of the ray about the mirror gives its true way, on which it may meet the
next one.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from estimator.geometry.wall_2d import Wall, mirrored, unit_normal

DEEPEST = 4
"""Longest chain of mirrors that is unfolded."""
GRAZING = 1e-9
"""Least distance from one bounce to the next. [m]."""

Chain = tuple[int, ...]
"""Indices of mirrors, from the array outward."""


def unfolded(
    points: Float[np.ndarray, "points 3"], walls: Sequence[Wall], *, deepest: int = DEEPEST
) -> tuple[Float[np.ndarray, "points 3"], Int[np.ndarray, "points deepest"]]:
    """Put points of the image, as seen by an array at the origin, where they really are.

    Parameters
    ----------
    points
        Places in the raw image. [m]
    walls
        All mirrors, at their true place.
    deepest
        Most mirrors that are followed.

    Returns
    -------
    The true places [m], and for each point the mirrors on its way, from the array outward,
    filled up with -1.
    """
    # A row for each coordinate: of images with millions of points, each is read by itself.
    left, heading = _rays(points)
    place = np.zeros_like(heading)
    chains = np.full((len(points), deepest), -1, dtype=np.int64)
    going = np.arange(len(points))
    for bounce in range(deepest):
        if not (walls and going.size):
            break
        before = chains[going, bounce - 1] if bounce else np.full(going.size, -1)
        rays = place[:, going], heading[:, going]
        distance = np.stack([_crossings(*rays, wall) for wall in walls])
        distance[before[None, :] == np.arange(len(walls))[:, None]] = np.inf
        first = np.argmin(distance, axis=0)
        nearest = distance[first, np.arange(going.size)]
        met = nearest < left[going]
        going, first, nearest = going[met], first[met], nearest[met]
        chains[going, bounce] = first
        place[:, going] += nearest * heading[:, going]
        left[going] -= nearest
        normals = np.stack([wall.normal for wall in walls], axis=-1)[:, first]
        turn = np.einsum("xp,xp->p", heading[:, going], normals)
        heading[:, going] -= 2 * turn * normals
    return np.ascontiguousarray((place + left * heading).T), chains


def image_over(
    points: Float[np.ndarray, "*grid 3"], walls: Sequence[Wall], chain: Chain
) -> Float[np.ndarray, "*grid 3"]:
    """Return where the raw image shows true places that are seen over a chain. [m]."""
    for index in reversed(chain):
        points = mirrored(points, walls[index].start, walls[index].end)
    return points


def possible_chains(walls: Sequence[Wall], *, deepest: int = DEEPEST) -> Iterator[Chain]:
    """Go through the chains that some ray from the array could follow; the empty one first.

    A chain is possible if its mirrors' images have a common interval of directions in which
    each lies behind the one before it somewhere. What stands between is not looked at.
    """
    yield from _continued(walls, (), (-np.pi, np.pi), deepest)


def _continued(
    walls: Sequence[Wall], chain: Chain, cone: tuple[float, float], deepest: int
) -> Iterator[Chain]:
    yield chain
    if len(chain) == deepest:
        return
    for index, wall in enumerate(walls):
        if chain and chain[-1] == index:
            continue
        image = image_over(np.stack([wall.start, wall.end]), walls, chain)
        ends = np.arctan2(image[:, 1], image[:, 0])
        if np.ptp(ends) > np.pi:  # across the negative x axis, behind the array
            continue
        narrower = max(cone[0], float(ends.min())), min(cone[1], float(ends.max()))
        if narrower[0] < narrower[1] and (not chain or _behind(image, walls, chain)):
            yield from _continued(walls, (*chain, index), narrower, deepest)


def _behind(image: Float[np.ndarray, "2 3"], walls: Sequence[Wall], chain: Chain) -> bool:
    """Tell whether part of a segment of the image lies beyond the image of a chain's last wall."""
    last = walls[chain[-1]]
    door = image_over(np.stack([last.start, last.end]), walls, chain[:-1])
    normal = unit_normal(door[0], door[1])
    here = float(door[0] @ normal)
    return bool(np.any((image @ normal - here) * np.sign(here) > 0))


def seen_over(
    images: Float[np.ndarray, "points 3"], walls: Sequence[Wall], chain: Chain
) -> Bool[np.ndarray, " points"]:
    """Tell which points of the raw image are seen over exactly this chain of mirrors."""
    seen = np.ones(len(images), dtype=bool)
    if chain:  # most points are outside the first mirror: they need not be followed
        distance, heading = _rays(images)
        seen = _crossings(np.zeros((3, 1)), heading, walls[chain[0]]) < distance
    deepest = min(len(chain) + 1, DEEPEST)
    met = unfolded(images[seen], walls, deepest=deepest)[1]
    wanted = np.full(deepest, -1)
    wanted[: len(chain)] = chain
    seen[seen] = np.all(met == wanted, axis=1)
    return seen


def _rays(
    points: Float[np.ndarray, "points 3"],
) -> tuple[Float[np.ndarray, " points"], Float[np.ndarray, "3 points"]]:
    """Return the distance of points [m] and the directions to them, a row for each coordinate."""
    rows = np.ascontiguousarray(points.T)
    distance = np.sqrt(np.einsum("xp,xp->p", rows, rows))
    return distance, rows / np.maximum(distance, np.finfo(float).tiny)


def _crossings(
    origins: Float[np.ndarray, "3 #rays"], headings: Float[np.ndarray, "3 rays"], wall: Wall
) -> Float[np.ndarray, " rays"]:
    """Return the distance at which each ray meets an upright wall; infinity if it does not. [m]."""
    (nx, ny, _), (ax, ay, _) = wall.normal, wall.end - wall.start
    x, y = origins[0] - wall.start[0], origins[1] - wall.start[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = -(x * nx + y * ny) / (headings[0] * nx + headings[1] * ny)
        share = x * ax + y * ay + distance * (headings[0] * ax + headings[1] * ay)
    hit = (distance > GRAZING) & (share >= 0) & (share <= ax * ax + ay * ay)
    return np.where(hit, distance, np.inf)
