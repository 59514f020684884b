"""A straight wall in the plane: its line, its ends, images in it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.geometry.flat_wall import GRAZING


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
    def point(self) -> Float[np.ndarray, " 3"]:
        """Where it starts. [m]."""
        return self.start

    @property
    def normal(self) -> Float[np.ndarray, " 3"]:
        """Unit normal, to the right of start to end."""
        return unit_normal(self.start, self.end)

    def mirrored(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Mirror points about its line, whatever its extent. [m]."""
        return mirrored(points, self.start, self.end)

    def hit(
        self, origin: Float[np.ndarray, " 3"], heading: Float[np.ndarray, " 3"]
    ) -> tuple[float, float] | None:
        """Return how far a ray goes to the wall, and to its nearer end from there. [m]."""
        return crossing(origin, heading, self.start, self.end)

    def hits(
        self,
        origins: Float[np.ndarray, "3 #rays"],
        headings: Float[np.ndarray, "3 rays"],
        limits: Float[np.ndarray, " rays"],
    ) -> Float[np.ndarray, " rays"]:
        """Return how far each ray goes to the upright wall; infinity if it does not meet it. [m].

        The limits are those of the interface; of a segment, all crossings cost the same.
        """
        (nx, ny, _), (ax, ay, _) = self.normal, self.end - self.start
        x, y = origins[0] - self.start[0], origins[1] - self.start[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -(x * nx + y * ny) / (headings[0] * nx + headings[1] * ny)
            share = x * ax + y * ay + distance * (headings[0] * ax + headings[1] * ay)
        met = (distance > GRAZING) & (share >= 0) & (share <= ax * ax + ay * ay)
        return np.where(met, distance, np.inf)

    def moved(self, change: Float[np.ndarray, " 2"]) -> "Wall":
        """Turn the wall about its midpoint (counter-clockwise) and move it along its normal."""
        tilt, offset = float(change[0]), float(change[1])
        middle, half = 0.5 * (self.start + self.end), 0.5 * (self.end - self.start)
        cosine, sine = np.cos(tilt), np.sin(tilt)
        turned = np.array([cosine * half[0] - sine * half[1], sine * half[0] + cosine * half[1], 0])
        middle = middle + offset * unit_normal(middle - turned, middle + turned)
        return Wall(start=middle - turned, end=middle + turned, covariance=self.covariance)


def mirrored(
    points: Float[np.ndarray, "*n 3"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
) -> Float[np.ndarray, "*n 3"]:
    """Mirror points about the line through two points of the array's plane. [m]."""
    normal = unit_normal(start, end)
    images: np.ndarray = points - 2 * ((points - start) @ normal)[..., None] * normal
    return images


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
