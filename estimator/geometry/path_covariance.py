"""How well a predicted path is known: from the covariances of the user's position and the walls.

Inputs are the user's x and y, then each wall's angle and offset, as
:class:`estimator.geometry.wall_2d.Wall` counts them; to first order.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.path_tracing import slopes_by_wall
from estimator.geometry.specular_chains import Chain, image_over, unfolded_over
from estimator.geometry.wall_2d import Wall


def input_covariance(
    user: Float[np.ndarray, " 3"],
    covariance: Float[np.ndarray, "3 3"],
    walls: Sequence[Wall],
    over: Chain,
    wall_covariance: Float[np.ndarray, "walls walls"] | None,
) -> Float[np.ndarray, "all all"]:
    """Return the joint covariance of what a path depends on.

    Parameters
    ----------
    user, covariance
        In the array's frame; only x and y count. [m], [m²]
    walls
        All mirrors.
    over
        Mirrors over which the position was found, so that it errs together with them.
    wall_covariance
        Of all walls' (angle [rad], offset [m]); None: each has its own.

    Raises
    ------
    ValueError
        If the walls of ``over`` alone make the position less certain than it is said to be.
    """
    inputs = np.zeros((2 + 2 * len(walls), 2 + 2 * len(walls)))
    inputs[:2, :2] = covariance[:2, :2]
    if wall_covariance is not None:
        inputs[2:, 2:] = wall_covariance
    else:
        for index, wall in enumerate(walls):
            at = slice(2 + 2 * index, 4 + 2 * index)
            inputs[at, at] = wall.covariance
    if over:
        if not rests_on(user, inputs, walls, over):
            raise ValueError(
                f"the walls {over} alone make a position found over them less certain than "
                "its covariance says; leave `over` out for a position that was not found so"
            )
        together = _place_by_walls(user, walls, over) @ inputs[2:, 2:]
        inputs[:2, 2:], inputs[2:, :2] = together, together.T
    return inputs


def rests_on(
    user: Float[np.ndarray, " 3"],
    inputs: Float[np.ndarray, "all all"],
    walls: Sequence[Wall],
    over: Chain,
) -> bool:
    """Tell whether a position's covariance holds what the walls of a chain put into it."""
    by_walls = _place_by_walls(user, walls, over)
    rest = inputs[:2, :2] - by_walls @ inputs[2:, 2:] @ by_walls.T
    slack = 1e-6 * float(np.trace(inputs[:2, :2]))  # of the differences
    return bool(np.linalg.eigvalsh(rest).min() >= -slack)


def _place_by_walls(
    user: Float[np.ndarray, " 3"], walls: Sequence[Wall], over: Chain
) -> Float[np.ndarray, "2 parameters"]:
    """Differentiate the place of a ghost that is unfolded over a chain by all walls."""
    ghost = image_over(user, walls, over)

    return _by_walls(lambda moved: unfolded_over(ghost, moved, over), walls, over)


def path_covariance(
    user: Float[np.ndarray, " 3"],
    inputs: Float[np.ndarray, "all all"],
    walls: Sequence[Wall],
    chain: Chain,
) -> Float[np.ndarray, "2 2"]:
    """Return the covariance of angle and length of the path over a chain."""
    image = image_over(user, walls, chain)
    # Mirroring keeps differences straight: a step of 1 m is as good as a small one.
    by_place = np.stack(
        [(image_over(user + axis, walls, chain) - image)[:2] for axis in np.eye(3)[:2]], axis=-1
    )
    by_walls = _by_walls(lambda moved: image_over(user, moved, chain), walls, chain)
    slopes = polar_slopes(image[:2]) @ np.concatenate([by_place, by_walls], axis=1)
    return np.asarray(slopes @ inputs @ slopes.T)


def _by_walls(
    place: Callable[[Sequence[FlatWall]], Float[np.ndarray, " 3"]],
    walls: Sequence[Wall],
    chain: Chain,
) -> Float[np.ndarray, "2 parameters"]:
    """Differentiate a place by the angle and offset of each wall that it depends on."""
    slopes = np.zeros((2, 2 * len(walls)))
    for index in set(chain):
        slopes[:, 2 * index : 2 * index + 2] = slopes_by_wall(place, walls, index)[:2]
    return slopes


def polar_slopes(image: Float[np.ndarray, " 2"]) -> Float[np.ndarray, "2 2"]:
    """Differentiate (angle, length) by x and y."""
    length = float(np.linalg.norm(image))
    x, y = image / length
    return np.array([[-y / length, x / length], [x, y]])
