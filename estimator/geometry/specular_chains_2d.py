"""Which chains of upright walls a ray from a linear array can follow at all."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from estimator.geometry.specular_chains import LONGEST_CHAIN, Chain, image_over
from estimator.geometry.wall_2d import Wall, unit_normal


def possible_chains(
    walls: Sequence[Wall], *, deepest: int = LONGEST_CHAIN, reach: float = np.inf
) -> Iterator[Chain]:
    """Go through the chains that some ray from the array could follow; the empty one first.

    A chain is possible if its mirrors' images have a common interval of directions in which
    each lies behind the one before it somewhere. What stands between is not looked at.

    Parameters
    ----------
    walls
        All mirrors, at their true place.
    deepest
        Most mirrors of a chain.
    reach
        Longest path that is of interest: a chain whose last mirror appears beyond is none. [m]
    """
    yield from _continued(walls, (), (-np.pi, np.pi), deepest, reach)


def _continued(
    walls: Sequence[Wall], chain: Chain, cone: tuple[float, float], deepest: int, reach: float
) -> Iterator[Chain]:
    yield chain
    if len(chain) == deepest:
        return
    for index, wall in enumerate(walls):
        if chain and chain[-1] == index:
            continue
        image = image_over(np.stack([wall.start, wall.end]), walls, chain)
        low, high = _directions(image)
        narrower = max(cone[0], low), min(cone[1], high)
        if narrower[0] >= narrower[1] or _nearest(image) > reach:
            continue
        if not chain or _behind(image, walls, chain):
            yield from _continued(walls, (*chain, index), narrower, deepest, reach)


def _directions(image: Float[np.ndarray, "2 3"]) -> tuple[float, float]:
    """Return the angles between which the array, at the origin, sees a segment. [rad].

    Of one that crosses the negative x axis it is the part before the array, y > 0.
    """
    ends = np.arctan2(image[:, 1], image[:, 0])
    low, high = float(ends.min()), float(ends.max())
    return (high, np.pi) if high - low > np.pi else (low, high)


def _behind(image: Float[np.ndarray, "2 3"], walls: Sequence[Wall], chain: Chain) -> bool:
    """Tell whether part of a segment of the image lies beyond the image of a chain's last wall."""
    last = walls[chain[-1]]
    door = image_over(np.stack([last.start, last.end]), walls, chain[:-1])
    normal = unit_normal(door[0], door[1])
    here = float(door[0] @ normal)
    return bool(np.any((image @ normal - here) * np.sign(here) > 0))


def _nearest(segment: Float[np.ndarray, "2 3"]) -> float:
    """Distance of a segment from the array at the origin. [m]."""
    along = segment[1] - segment[0]
    share = float(np.clip(-(segment[0] @ along) / (along @ along), 0.0, 1.0))
    return float(np.linalg.norm(segment[0] + share * along))
