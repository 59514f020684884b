"""Projection in space: launch a ray and fold it at each plane mirror that it meets."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.geometry.wall_3d import PlaneWall, mirrored_about, within

MOST_BOUNCES = 8
GRAZING = 1e-9
"""Least distance from one bounce to the next. [m]."""
STEP = 1e-6
"""Step of the numerical derivatives: in metres, cosines and slopes alike."""


@dataclass(frozen=True, kw_only=True)
class SpaceProjection:
    """Where a path of known direction and length ends."""

    position: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "3 3"]  # [m²]
    walls: tuple[int, ...]  # met on the way, from the array outward
    path: Float[np.ndarray, "vertices 3"]  # array, bounces, user [m]


def folded_over(
    images: Float[np.ndarray, "*n 3"], walls: Sequence[PlaneWall], chain: Sequence[int]
) -> Float[np.ndarray, "*n 3"]:
    """Return where things really are that the raw image shows over a chain of mirrors. [m].

    Parameters
    ----------
    images
        As the array sees them. [m]
    walls
        All mirrors, at their true place.
    chain
        Their indices, from the array outward.
    """
    for index in chain:
        images = mirrored_about(images, walls[index])
    return images


def central_slopes(
    value: Callable[[Float[np.ndarray, " 3"]], Float[np.ndarray, " 3"]],
) -> Float[np.ndarray, "3 3"]:
    """Return the derivatives of a value at a step of 0 over the step's coordinates."""
    steps = np.eye(3) * STEP
    return np.stack([value(step) - value(-step) for step in steps], axis=-1) / (2 * STEP)


def slopes_by_wall(
    value: Callable[[Sequence[PlaneWall]], Float[np.ndarray, " 3"]],
    walls: Sequence[PlaneWall],
    index: int,
) -> Float[np.ndarray, "3 3"]:
    """Return the derivatives of a value over (tilts, offset) of one of the walls it rests on."""

    def moved(change: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
        return value([*walls[:index], walls[index].moved(change), *walls[index + 1 :]])

    return central_slopes(moved)


def project_in_space(
    cosines: tuple[float, float],
    path_length: float,
    walls: Sequence[PlaneWall],
    *,
    covariance: Float[np.ndarray, "3 3"],
    margin: float = 0.0,
) -> SpaceProjection:
    """Follow a path from the array, at the origin, to its end.

    Parameters
    ----------
    cosines
        Of the direction, along x and z. [-]
    path_length
        Length of the whole path. [m]
    walls
        All mirrors, at their true place.
    covariance
        Of (cosine along x, cosine along z, path length).
    margin
        By how much each wall is taken to be wider than it was seen. [m]

    Returns
    -------
    The end, with the covariance that the path's and the walls' imply to first order.
    """
    path, met = _trace(cosines, path_length, walls, margin)
    parameters = np.array([*cosines, path_length])
    by_path = central_slopes(lambda step: _end(parameters + step, walls, met))
    total = by_path @ covariance @ by_path.T
    for index in set(met):
        by_wall = slopes_by_wall(lambda moved: _end(parameters, moved, met), walls, index)
        total = total + by_wall @ walls[index].covariance @ by_wall.T
    return SpaceProjection(position=path[-1], covariance=total, walls=tuple(met), path=path)


def _towards(cosines: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " 3"]:
    ahead = np.sqrt(max(1 - float(cosines @ cosines), 0.0))
    return np.array([cosines[0], ahead, cosines[1]])


def _trace(
    cosines: tuple[float, float], path_length: float, walls: Sequence[PlaneWall], margin: float
) -> tuple[Float[np.ndarray, "vertices 3"], list[int]]:
    place, direction = np.zeros(3), _towards(np.array(cosines))
    left = path_length
    vertices, met = [place], list[int]()
    while len(met) < MOST_BOUNCES:
        hits = []
        for index, wall in enumerate(walls):
            slope = float(direction @ wall.normal)
            if (met and met[-1] == index) or abs(slope) < 1e-12:
                continue
            distance = float((wall.centre - place) @ wall.normal) / slope
            if not GRAZING < distance < left:
                continue
            if within((place + distance * direction)[None], wall, margin=margin)[0]:
                hits.append((distance, index))
        if not hits:
            break
        distance, index = min(hits)
        place = place + distance * direction
        normal = walls[index].normal
        direction = direction - 2 * (direction @ normal) * normal
        left -= distance
        vertices.append(place)
        met.append(index)
    vertices.append(place + left * direction)
    return np.stack(vertices), met


def _end(
    parameters: Float[np.ndarray, " 3"], walls: Sequence[PlaneWall], chain: Sequence[int]
) -> Float[np.ndarray, " 3"]:
    """End of the path over a given chain of mirrors, whatever their extent."""
    # The images of later walls, as the array sees them, fold back in turn.
    return folded_over(parameters[2] * _towards(parameters[:2]), walls, chain)
