"""How well walls, and places seen over them, are known once they are unfolded.

A wall that is seen over mirrors is mirrored back about each of them. Its place then depends on
theirs: an error of a mirror's tilt turns the unfolded wall twice, and the errors of both are
correlated. To first order, in the plane and in space.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar, cast

import numpy as np
from jaxtyping import Float

from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.path_tracing import STEP, slopes_by_wall
from estimator.geometry.specular_chains import Chain, unfolded_over

SomeWall = TypeVar("SomeWall", bound=FlatWall)


def joint_covariance(
    seen: Sequence[SomeWall],
    chains: Sequence[Chain],
    walls: Sequence[SomeWall],
    *,
    reflected: Callable[[SomeWall, SomeWall], SomeWall],
    change: Callable[[SomeWall, SomeWall], Float[np.ndarray, " parameters"]],
) -> Float[np.ndarray, "all all"]:
    """Propagate the covariances of walls as they are seen, which are independent, to the true ones.

    Parameters
    ----------
    seen
        Walls as the image shows them; those of a wall's chain come before it.
    chains
        Over which of them each is seen, from the array outward.
    walls
        The same at their true place.
    reflected
        Returns a wall's image in another.
    change
        Returns (tilts [rad], offset [m]) of a wall from its old place.

    Returns
    -------
    Covariance of (tilts, offset) of all walls, one wall after the other.
    """
    ends = np.cumsum([0, *(len(wall.covariance) for wall in seen)])
    own = np.zeros((ends[-1], ends[-1]))
    slopes = np.zeros((ends[-1], ends[-1]))
    for i, wall in enumerate(seen):
        rows = slice(ends[i], ends[i + 1])
        own[rows, rows] = wall.covariance
        for j, unit in enumerate(np.eye(len(wall.covariance)) * STEP):
            moves = []
            for step in (unit, -unit):
                # All are moved, most by nothing: what that rounds is gone in the difference.
                shifted = [
                    cast(SomeWall, one.moved(step if k == i else 0 * step))  # a wall stays one
                    for k, one in enumerate(seen)
                ]
                again = _unfolded_again(shifted, chains, reflected)
                moves.append(
                    np.concatenate([change(*both) for both in zip(again, walls, strict=True)])
                )
            slopes[:, ends[i] + j] = (moves[0] - moves[1]) / (2 * STEP)
    joint: np.ndarray = slopes @ own @ slopes.T
    return joint


def _unfolded_again(
    seen: Sequence[SomeWall],
    chains: Sequence[Chain],
    reflected: Callable[[SomeWall, SomeWall], SomeWall],
) -> list[SomeWall]:
    walls: list[SomeWall] = []
    for wall, chain in zip(seen, chains, strict=True):
        for index in chain:
            wall = reflected(wall, walls[index])
        walls.append(wall)
    return walls


def place_covariance(
    ghost: Float[np.ndarray, " 3"],
    covariance: Float[np.ndarray, "3 3"],
    walls: Sequence[FlatWall],
    joint: Float[np.ndarray, "parameters parameters"],
    chain: Chain,
) -> Float[np.ndarray, "3 3"]:
    """Propagate the covariance of a place in the image, and of the mirrors, to its true place.

    Parameters
    ----------
    ghost
        Where the image shows it. [m]
    covariance
        Of that place. [m²]
    walls
        At their true place.
    joint
        Covariance of (tilts, offset) of all of them.
    chain
        The mirrors over which it is seen.

    Returns
    -------
    Covariance of the unfolded place. [m²]
    """
    turn = np.stack(
        [
            unfolded_over(ghost + axis, walls, chain) - unfolded_over(ghost, walls, chain)
            for axis in np.eye(3)
        ],
        axis=-1,
    )
    total: np.ndarray = turn @ covariance @ turn.T
    ends = np.cumsum([0, *(len(wall.covariance) for wall in walls)])
    over = sorted(set(chain))
    if over:
        by_walls = np.concatenate(
            [
                slopes_by_wall(lambda moved: unfolded_over(ghost, moved, chain), walls, index)
                for index in over
            ],
            axis=-1,
        )
        parameters = np.concatenate([np.arange(ends[i], ends[i + 1]) for i in over])
        total = total + by_walls @ joint[np.ix_(parameters, parameters)] @ by_walls.T
    return total
