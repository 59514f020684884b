"""A flat wall in space: its plane, its corners, images in it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from estimator.geometry.flat_wall import GRAZING

PARALLEL = 1e-12
"""Sine of the angle between a ray and a plane below which they are parallel. [-]"""


@dataclass(frozen=True, kw_only=True)
class PlaneWall:
    """A flat mirror in space: a convex polygon, with what is known of its plane."""

    corners: Float[np.ndarray, "corners 3"]  # in order around it, in its plane [m]
    centre: Float[np.ndarray, " 3"]  # where the covariance is counted from [m]
    axes: Float[np.ndarray, "2 3"]  # unit vectors in the plane
    covariance: Float[np.ndarray, "3 3"]  # of (tilt along each axis [rad], offset [m])

    @property
    def point(self) -> Float[np.ndarray, " 3"]:
        """Where the covariance is counted from. [m]."""
        return self.centre

    @property
    def normal(self) -> Float[np.ndarray, " 3"]:
        """Unit vector across, the first axis cross the second."""
        return np.cross(self.axes[0], self.axes[1])

    def mirrored(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Mirror points about its plane, whatever its extent. [m]."""
        return mirrored_about(points, self)

    def hit(
        self, origin: Float[np.ndarray, " 3"], heading: Float[np.ndarray, " 3"]
    ) -> tuple[float, float] | None:
        """Return how far a ray goes to the wall, and to its rim from there. [m]."""
        slope = float(heading @ self.normal)
        if abs(slope) < PARALLEL:
            return None
        distance = float((self.centre - origin) @ self.normal) / slope
        depth = float(_depth((origin + distance * heading)[None], self)[0])
        return (distance, depth) if distance > 0 and depth >= 0 else None

    def hits(
        self,
        origins: Float[np.ndarray, "3 #rays"],
        headings: Float[np.ndarray, "3 rays"],
        limits: Float[np.ndarray, " rays"],
    ) -> Float[np.ndarray, " rays"]:
        """Return how far each ray goes to the wall; infinity if it does not within its limit."""
        normal = self.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (self.centre @ normal - normal @ origins) / (normal @ headings)
        met = np.flatnonzero((distance > GRAZING) & (distance < limits))
        starts = np.broadcast_to(origins, headings.shape)
        crossings = starts[:, met] + distance[met] * headings[:, met]
        met = met[within(np.ascontiguousarray(crossings.T), self)]
        reached = np.full(headings.shape[1], np.inf)
        reached[met] = distance[met]
        return reached

    def moved(self, change: Float[np.ndarray, " 3"]) -> "PlaneWall":
        """Tilt the plane about its centre, so that it rises by a slope, and offset it."""
        normal = self.normal
        rise = (self.corners - self.centre) @ (self.axes.T @ change[:2]) + change[2]
        tilted = self.axes + change[:2, None] * normal
        first = tilted[0] / np.linalg.norm(tilted[0])
        second = tilted[1] - (tilted[1] @ first) * first
        return PlaneWall(
            corners=self.corners + rise[:, None] * normal,
            centre=self.centre + change[2] * normal,
            axes=np.stack([first, second / np.linalg.norm(second)]),
            covariance=self.covariance,
        )


def mirrored_about(points: Float[np.ndarray, "*n 3"], wall: PlaneWall) -> Float[np.ndarray, "*n 3"]:
    """Mirror points about a wall's plane. [m]."""
    normal = wall.normal
    height = np.einsum("...x,x->...", points - wall.centre, normal)
    images: np.ndarray = points - 2 * height[..., None] * normal
    return images


def within(
    points: Float[np.ndarray, "n 3"], wall: PlaneWall, *, margin: float = 0.0
) -> Bool[np.ndarray, " n"]:
    """Tell which points of a wall's plane lie in its polygon, widened by a margin [m]."""
    inside: np.ndarray = _depth(points, wall) >= -margin
    return inside


def _depth(points: Float[np.ndarray, "n 3"], wall: PlaneWall) -> Float[np.ndarray, " n"]:
    """Distance of points of a wall's plane from its nearest edge's line, inward. [m]."""
    corners = (wall.corners - wall.centre) @ wall.axes.T
    places = (points - wall.centre) @ wall.axes.T
    edges = np.roll(corners, -1, axis=0) - corners
    turn = np.sign(
        np.sum(
            corners[:, 0] * np.roll(corners[:, 1], -1) - corners[:, 1] * np.roll(corners[:, 0], -1)
        )
    )
    inward = turn * np.stack([-edges[:, 1], edges[:, 0]], axis=-1)
    inward = inward / np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-12)
    depth = np.einsum("nex,ex->ne", places[:, None, :] - corners, inward)
    nearest: np.ndarray = depth.min(axis=1)
    return nearest


def hidden_by(
    points: Float[np.ndarray, "n 3"], wall: PlaneWall, *, margin: float = 0.0
) -> Bool[np.ndarray, " n"]:
    """Tell which points the array, at the origin, sees through a wall."""
    normal = wall.normal
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (wall.centre @ normal) / (points @ normal)
    crossed = (share > 0) & (share < 1)
    hidden = np.zeros(len(points), dtype=bool)
    hidden[crossed] = within(share[crossed, None] * points[crossed], wall, margin=margin)
    return hidden
