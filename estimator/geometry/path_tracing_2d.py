"""Projection: launch a ray at an angle of arrival and fold it at each mirror it meets."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

MOST_BOUNCES = 8
GRAZING = 1e-9
"""Least distance from one bounce to the next. [m]."""


def unit_normal(
    start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, " 3"]:
    """Return a line's unit normal: its direction turned by -90 degrees in the array's plane."""
    along = (end - start) / np.linalg.norm(end - start)
    return np.array([along[1], -along[0], 0.0])


@dataclass(frozen=True, kw_only=True)
class Wall:
    """A flat mirror in the array's plane, with what is known of its line."""

    start: Float[np.ndarray, " 3"]  # [m]
    end: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "2 2"]  # of (angle [rad], offset [m]) at the midpoint

    @property
    def normal(self) -> Float[np.ndarray, " 3"]:
        """Unit normal, to the right of start to end."""
        return unit_normal(self.start, self.end)

    def moved(self, *, tilt: float, offset: float) -> "Wall":
        """Turn the wall about its midpoint (counter-clockwise) and move it along its normal."""
        middle, half = 0.5 * (self.start + self.end), 0.5 * (self.end - self.start)
        cosine, sine = np.cos(tilt), np.sin(tilt)
        turned = np.array([cosine * half[0] - sine * half[1], sine * half[0] + cosine * half[1], 0])
        middle = middle + offset * unit_normal(middle - turned, middle + turned)
        return Wall(start=middle - turned, end=middle + turned, covariance=self.covariance)


@dataclass(frozen=True, kw_only=True)
class Projection:
    """Where a path of known angle and length ends."""

    position: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "3 3"]  # [m²]
    walls: tuple[int, ...]  # met on the way, from the array outward
    path: Float[np.ndarray, "vertices 3"]  # array, bounces, user [m]
    margin: float  # least distance of a bounce from an end of its wall; inf without [m]


def mirrored(
    points: Float[np.ndarray, "*n 3"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> Float[np.ndarray, "*n 3"]:
    """Mirror points about the line through two points of the array's plane. [m]."""
    normal = unit_normal(start, end)
    images: np.ndarray = points - 2 * ((points - start) @ normal)[..., None] * normal
    return images


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


def crossing(
    origin: Float[np.ndarray, " 3"],
    direction: Float[np.ndarray, " 3"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> tuple[float, float] | None:
    """Intersect a ray with a segment in the plane z = 0.

    Returns
    -------
    The distance along the ray and the distance to the nearer end of the segment [m]; or
    ``None`` if they do not meet.
    """
    along = end - start
    length = float(np.linalg.norm(along))
    system = np.stack([direction[:2], -along[:2]], axis=-1)
    if abs(np.linalg.det(system)) < 1e-12 * length:
        return None
    distance, share = np.linalg.solve(system, (start - origin)[:2])
    if distance <= 0 or not 0 <= share <= 1:
        return None
    return float(distance), length * float(min(share, 1 - share))
