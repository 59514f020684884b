"""Chains of mirrors: which ones stand between the array and what its image shows.

In the image a ray from the array is straight. Whatever it shows behind a mirror is seen over it:
mirroring the rest of the ray about the mirror gives its true way, on which it may meet the
next one. In the plane and in space alike; which chains can be at all is worked out in
:mod:`estimator.geometry.specular_chains_2d` and :mod:`estimator.geometry.specular_chains_3d`.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from estimator.geometry.flat_wall import FlatWall

LONGEST_CHAIN = 8
"""Most mirrors on one path, everywhere in the estimator: the most that scenarios may ask for. Each
reflection takes 6 dB (ITU-R P.2040-4, plasterboard) or more: after eight 48 dB are gone, more than
the 45 dB between a path and the sidelobes of the survey's taper."""

Chain = tuple[int, ...]
"""Indices of mirrors, from the array outward."""


def checked_bounces(max_bounces: int) -> int:
    """Return a number of bounces that can be followed.

    Raises
    ------
    ValueError
        If it is negative or above :data:`LONGEST_CHAIN`.
    """
    if not 0 <= max_bounces <= LONGEST_CHAIN:
        raise ValueError(
            f"max_bounces = {max_bounces}: chains of 0 to {LONGEST_CHAIN} mirrors are followed; "
            "beyond, a path is weaker than the sidelobes of others"
        )
    return max_bounces


def image_over(
    points: Float[np.ndarray, "*grid 3"], walls: Sequence[FlatWall], chain: Chain
) -> Float[np.ndarray, "*grid 3"]:
    """Return where the raw image shows true places that are seen over a chain. [m]."""
    for index in reversed(chain):
        points = walls[index].mirrored(points)
    return points


def unfolded_over(
    images: Float[np.ndarray, "*grid 3"], walls: Sequence[FlatWall], chain: Chain
) -> Float[np.ndarray, "*grid 3"]:
    """Return the true places of what the raw image shows over a chain, whatever its extent. [m]."""
    # The images of later walls, as the array sees them, unfold one after the other.
    for index in chain:
        images = walls[index].mirrored(images)
    return images


def unfolded(
    points: Float[np.ndarray, "points 3"],
    walls: Sequence[FlatWall],
    *,
    deepest: int = LONGEST_CHAIN,
    skin: float = 0.0,
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
    skin
        How far behind a wall a ray must go on to be unfolded there: what is less far is the wall's
        own image. [m]

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
        distance = np.stack([wall.hits(*rays, left[going]) for wall in walls])
        distance[before[None, :] == np.arange(len(walls))[:, None]] = np.inf
        if skin > 0:
            slopes = np.abs(np.stack([wall.normal for wall in walls]) @ rays[1])
            with np.errstate(invalid="ignore"):
                distance[(left[going] - distance) * slopes <= skin] = np.inf
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


def chain_to(
    place: Float[np.ndarray, " 3"],
    walls: Sequence[FlatWall],
    *,
    deepest: int = LONGEST_CHAIN,
    skin: float = 0.0,
) -> Chain:
    """Return the mirrors over which the array sees a place of its raw image."""
    met = unfolded(place[None], walls, deepest=deepest, skin=skin)[1][0]
    return tuple(int(index) for index in met if index >= 0)


def seen_over(
    images: Float[np.ndarray, "points 3"],
    walls: Sequence[FlatWall],
    chain: Chain,
    *,
    skin: float = 0.0,
) -> Bool[np.ndarray, " points"]:
    """Tell which points of the raw image are seen over exactly this chain of mirrors."""
    seen = np.ones(len(images), dtype=bool)
    if chain:  # most points are outside the first mirror: they need not be followed
        distance, heading = _rays(images)
        seen = walls[chain[0]].hits(np.zeros((3, 1)), heading, distance) < distance
    deepest = min(len(chain) + 1, LONGEST_CHAIN)
    met = unfolded(images[seen], walls, deepest=deepest, skin=skin)[1]
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
