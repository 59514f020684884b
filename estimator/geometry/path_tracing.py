"""Projection: launch a ray along a bearing and reflect it at each mirror that it meets."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.geometry.bearing import Bearing
from estimator.geometry.flat_wall import GRAZING, FlatWall
from estimator.geometry.specular_chains import LONGEST_CHAIN, Chain, unfolded_over

STEP = 1e-6
"""Of the central differences; as far from rounding as from the curvature. [m], [rad], [-]"""


@dataclass(frozen=True, kw_only=True)
class Projection:
    """Where a path of known bearing and length ends."""

    position: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "3 3"]  # [m²]
    walls: Chain  # met on the way, from the array outward
    path: Float[np.ndarray, "vertices 3"]  # array, bounces, user [m]
    margin: float  # least distance of a bounce from its wall's rim; inf without [m]


def project(
    how: Bearing,
    bearing: Float[np.ndarray, " angles"],
    path_length: float,
    walls: Sequence[FlatWall],
    *,
    covariance: Float[np.ndarray, "parameters parameters"],
    max_bounces: int = LONGEST_CHAIN,
) -> Projection:
    """Follow a path from the array, at the origin, to its end.

    Parameters
    ----------
    how
        What the array measures of a direction.
    bearing
        Of the path. [rad] or [-]
    path_length
        Length of the whole path. [m]
    walls
        All mirrors, at their true place.
    covariance
        Of (bearing, path length).
    max_bounces
        Most mirrors that are followed.

    Returns
    -------
    The end, with the covariance that the path's and the walls' imply to first order.
    """
    path, met, margin = trace(how.towards(bearing), path_length, walls, max_bounces=max_bounces)
    parameters = np.append(bearing, path_length)

    def end(
        values: Float[np.ndarray, " parameters"], moved: Sequence[FlatWall]
    ) -> Float[np.ndarray, " 3"]:
        """End of the path over the same chain of mirrors, whatever their extent."""
        return unfolded_over(values[-1] * how.towards(values[:-1]), moved, met)

    by_path = central_slopes(lambda step: end(parameters + step, walls), parameters.size)
    total = by_path @ covariance @ by_path.T
    for index in set(met):
        by_wall = slopes_by_wall(lambda moved: end(parameters, moved), walls, index)
        total = total + by_wall @ walls[index].covariance @ by_wall.T
    return Projection(position=path[-1], covariance=total, walls=met, path=path, margin=margin)


def trace(
    heading: Float[np.ndarray, " 3"],
    path_length: float,
    walls: Sequence[FlatWall],
    *,
    start: Float[np.ndarray, " 3"] | None = None,
    max_bounces: int = LONGEST_CHAIN,
) -> tuple[Float[np.ndarray, "vertices 3"], Chain, float]:
    """Follow a ray over all walls that it meets.

    Parameters
    ----------
    heading
        Unit vector.
    path_length, walls, max_bounces
        As in :func:`project`.
    start
        Where it starts; ``None``: the origin. [m]

    Returns
    -------
    Its vertices [m], the walls, and the least distance of a bounce from its wall's rim [m].
    """
    place = np.zeros(3) if start is None else start
    left, margin = path_length, np.inf
    vertices, met = [place], list[int]()
    while len(met) < max_bounces:
        hits = [
            (hit, index)
            for index, wall in enumerate(walls)
            if not (met and met[-1] == index)
            and (hit := wall.hit(place, heading)) is not None
            and GRAZING < hit[0] < left
        ]
        if not hits:
            break
        (distance, from_rim), index = min(hits)
        margin = min(margin, from_rim)
        place = place + distance * heading
        normal = walls[index].normal
        heading = heading - 2 * (heading @ normal) * normal
        left -= distance
        vertices.append(place)
        met.append(index)
    vertices.append(place + left * heading)
    return np.stack(vertices), tuple(met), margin


def central_slopes(
    value: Callable[[Float[np.ndarray, " steps"]], np.ndarray], steps: int
) -> Float[np.ndarray, "values steps"]:
    """Return the derivatives of a value at a step of 0 over the step's coordinates."""
    units = np.eye(steps) * STEP
    return np.stack([value(unit) - value(-unit) for unit in units], axis=-1) / (2 * STEP)


def slopes_by_wall(
    value: Callable[[Sequence[FlatWall]], np.ndarray], walls: Sequence[FlatWall], index: int
) -> Float[np.ndarray, "values parameters"]:
    """Return the derivatives of a value over (tilts, offset) of one of the walls it rests on."""

    def moved(change: Float[np.ndarray, " parameters"]) -> np.ndarray:
        return value([*walls[:index], walls[index].moved(change), *walls[index + 1 :]])

    return central_slopes(moved, len(walls[index].covariance))
