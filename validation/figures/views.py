"""The region of the plane that a figure shows."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.results.estimate import Estimate, Image

_ENERGY_KEPT = 0.98  # of an image's strong pixels inside its crop, along each axis


@dataclass(frozen=True, kw_only=True)
class View:
    """The part of the plane z = 0 that a figure shows."""

    left: float  # [m]
    right: float  # [m]
    bottom: float  # [m]
    top: float  # [m]

    @property
    def aspect(self) -> float:
        """Width over height."""
        return (self.right - self.left) / (self.top - self.bottom)


def view_around(
    points: Float[np.ndarray, "points 3"], *, margin: float = 0.08, narrowest: float = 0.45
) -> View:
    """Choose a view that contains all points.

    Parameters
    ----------
    points
        Points to be inside; NaN is ignored. [m]
    margin
        Space on each side, over the larger side of the view. [-]
    narrowest
        Least ratio of the two sides, for points in a row. [-]
    """
    low, high = np.nanmin(points[:, :2], axis=0), np.nanmax(points[:, :2], axis=0)
    size = high - low
    larger = max(float(size.max()), 1e-3)
    half = np.maximum(size, narrowest * larger) / 2 + margin * larger
    centre = (low + high) / 2
    (left, bottom), (right, top) = centre - half, centre + half
    return View(left=float(left), right=float(right), bottom=float(bottom), top=float(top))


def estimate_points(
    estimate: Estimate, positions: Float[np.ndarray, "positions 3"]
) -> Float[np.ndarray, "points 3"]:
    """Return the points of an estimate for its plan: array, mirrors, targets, users, paths."""
    points = [positions]
    points += [np.stack([mirror.start, mirror.end]) for mirror in estimate.mirrors]
    points += [target.position[None] for target in estimate.targets]
    for user in estimate.users:
        points += [place for place in (user.path,) if place is not None]
        points += [place[None] for place in (user.position,) if place is not None]
    return np.concatenate(points)


def ghost_points(estimate: Estimate) -> Float[np.ndarray, "points 3"]:
    """Return the positions of ghosts in the raw image."""
    points = [target.ghost[None] for target in estimate.targets]
    for mirror in estimate.mirrors:
        ends = np.stack([mirror.start, mirror.end])
        for index in reversed(mirror.seen_through):
            about = estimate.mirrors[index]
            ends = ends - 2 * ((ends - about.start) @ about.normal)[:, None] * about.normal
        points.append(ends)
    return np.concatenate(points) if points else np.zeros((0, 3))


def faintest_db(
    image: Image, things: Float[np.ndarray, "things 3"], *, within: float
) -> float | None:
    """Return the level of the faintest of some objects in an image, relative to its peak. [dB].

    Parameters
    ----------
    image
        In a plane.
    things
        Their positions; those outside the image are ignored. [m]
    within
        Distance along x and y within which the brightest pixel gives an object's level. [m]
    """
    magnitude = brightest_plane(image)
    peak = float(magnitude.max())
    levels = []
    for thing in things:
        near = np.ix_(
            np.abs(image.grid.x - thing[0]) <= within, np.abs(image.grid.y - thing[1]) <= within
        )
        level = float(magnitude[near].max(initial=0.0))
        if level > 0:
            levels.append(20 * np.log10(level / peak))
    return min(levels) if levels else None


def bright_points(image: Image, *, threshold_db: float = -20.0) -> Float[np.ndarray, "2 3"]:
    """Return two corners of the box that contains nearly all bright pixels of an image.

    Parameters
    ----------
    image
        In a plane.
    threshold_db
        Least level of bright pixels, relative to the peak. [dB]
    """
    power = np.abs(brightest_plane(image)) ** 2
    power = np.where(power >= power.max() * 10 ** (threshold_db / 10), power, 0.0)
    corners = np.zeros((2, 3))
    for axis, coordinate in enumerate((image.grid.x, image.grid.y)):
        share = np.cumsum(power.sum(axis=1 - axis))
        ends = np.searchsorted(share / share[-1], [(1 - _ENERGY_KEPT) / 2, (1 + _ENERGY_KEPT) / 2])
        corners[:, axis] = coordinate[np.minimum(ends, coordinate.size - 1)]
    return corners


def brightest_plane(image: Image) -> Float[np.ndarray, "x y"]:
    """Return the magnitude of an image, of a volume the brightest pixel along z [-]."""
    magnitude: np.ndarray = np.abs(image.values)
    return magnitude if magnitude.ndim == 2 else magnitude.max(axis=2)
