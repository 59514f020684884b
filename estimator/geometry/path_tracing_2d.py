"""Projection: launch a ray at an angle of arrival and fold it at each mirror it meets."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.geometry.wall_2d import Wall, crossing, mirrored

MOST_BOUNCES = 8
GRAZING = 1e-9
"""Least distance from one bounce to the next. [m]."""


@dataclass(frozen=True, kw_only=True)
class Projection:
    """Where a path of known angle and length ends."""

    position: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "3 3"]  # [m²]
    walls: tuple[int, ...]  # met on the way, from the array outward
    path: Float[np.ndarray, "vertices 3"]  # array, bounces, user [m]
    margin: float  # least distance of a bounce from an end of its wall; inf without [m]


def project(
    aoa: float,
    path_length: float,
    walls: Sequence[Wall],
    *,
    covariance: Float[np.ndarray, "2 2"],
) -> Projection:
    """Follow a path from the array, at the origin along +x, to its end.

    Parameters
    ----------
    aoa
        Angle from the array's axis. [rad]
    path_length
        Length of the whole path. [m]
    walls
        All mirrors, at their true place.
    covariance
        Of (aoa, path length).

    Returns
    -------
    The end, with the covariance that the path's and the walls' imply to first order.
    """
    path, met, margin = _trace(aoa, path_length, walls)

    def moved_end(
        change: Callable[[Float[np.ndarray, " 2"]], tuple[float, float, list[Wall]]],
    ) -> Float[np.ndarray, "3 2"]:
        """Differentiate the end by two parameters; the chain of walls is kept."""
        columns = []
        for unit in np.eye(2) * 1e-6:
            ends = [_follow(*change(sign * unit), met) for sign in (1.0, -1.0)]
            columns.append((ends[0] - ends[1]) / 2e-6)
        return np.stack(columns, axis=-1)

    by_path = moved_end(lambda x: (aoa + x[0], path_length + x[1], list(walls)))
    total = by_path @ covariance @ by_path.T
    for index in set(met):

        def move(x: Float[np.ndarray, " 2"], index: int = index) -> tuple[float, float, list[Wall]]:
            shifted = list(walls)
            shifted[index] = walls[index].moved(tilt=float(x[0]), offset=float(x[1]))
            return aoa, path_length, shifted

        by_wall = moved_end(move)
        total = total + by_wall @ walls[index].covariance @ by_wall.T
    return Projection(
        position=path[-1], covariance=total, walls=tuple(met), path=path, margin=margin
    )


def _trace(
    aoa: float, path_length: float, walls: Sequence[Wall]
) -> tuple[Float[np.ndarray, "vertices 3"], list[int], float]:
    place = np.zeros(3)
    direction = np.array([np.cos(aoa), np.sin(aoa), 0.0])
    left, margin = path_length, np.inf
    vertices, met = [place], list[int]()
    while len(met) < MOST_BOUNCES:
        hits = [
            (hit, index)
            for index, wall in enumerate(walls)
            if not (met and met[-1] == index)
            and (hit := crossing(place, direction, wall.start, wall.end)) is not None
            and GRAZING < hit[0] < left
        ]
        if not hits:
            break
        (distance, from_end), index = min(hits)
        margin = min(margin, from_end)
        place = place + distance * direction
        direction = _reflected(direction, walls[index])
        left -= distance
        vertices.append(place)
        met.append(index)
    vertices.append(place + left * direction)
    return np.stack(vertices), met, margin


def _follow(
    aoa: float, path_length: float, walls: Sequence[Wall], chain: Sequence[int]
) -> Float[np.ndarray, " 3"]:
    """End of the path over a given chain of mirrors, whatever their extent."""
    end = path_length * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    # The images of later walls, as the array sees them, fold back one after the other.
    for wall in [walls[index] for index in chain]:
        end = mirrored(end, wall.start, wall.end)
    return end


def _reflected(direction: Float[np.ndarray, " 3"], wall: Wall) -> Float[np.ndarray, " 3"]:
    return mirrored(direction, np.zeros(3), wall.end - wall.start)
