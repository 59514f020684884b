r"""One position from several paths: joint least squares over angles, delays and curvatures.

A path over the mirrors of a chain shows the user's image p = A u + t: the user u mirrored about
each of them, the last one first. The path's angle is that of p, its length |p|, and so is the
radius of its wavefront; a user's clock that is ahead by δ makes all lengths seem shorter by cδ:

.. math:: \theta = \arg p, \qquad R = |p| - c \delta, \qquad R_c = |p| .

Walls are uncertain too: with their parameters' covariance :math:`C_w` and the observations'
slopes H over these, errors of all paths have the covariance :math:`C + H C_w H^T`. Paths over
one wall share its errors, so they do not average them out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light
from scipy.stats import chi2

from estimator.geometry.wall_2d import Wall, mirrored

ROUNDS = 2
"""How often the walls' part of the covariance is taken at the place found. [-]."""
ITERATIONS = 20
CONVERGED = 1e-12
"""Step that ends an iteration. [m]."""
STEP = 1e-6
"""Of the derivatives by a wall's parameters. [rad], [m]."""
AGREE = 0.999
"""Probability with which true paths pass the test that they agree."""


@dataclass(frozen=True, kw_only=True)
class Sighting:
    """A path that is taken to come over a chain of mirrors."""

    path: int  # its index
    chain: tuple[int, ...]  # of walls, from the array outward


@dataclass(frozen=True, kw_only=True)
class Consensus:
    """Where some paths together put the user."""

    sightings: tuple[Sighting, ...]
    position: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "3 3"]  # [m²]
    chi_square: float  # weighted square of what is left over [-]
    freedom: int  # observations beyond the unknowns
    clock_offset: float | None  # of the user; None where it was not solved for [s]
    clock_deviation: float | None  # [s]

    @property
    def agrees(self) -> bool:
        """Whether all paths can be of one user at this position."""
        return self.freedom == 0 or self.chi_square < float(chi2.ppf(AGREE, self.freedom))


def block_covariance(walls: Sequence[Wall]) -> Float[np.ndarray, "parameters parameters"]:
    """Put the covariances of walls that were seen independently into one matrix."""
    joint = np.zeros((2 * len(walls), 2 * len(walls)))
    for index, wall in enumerate(walls):
        joint[2 * index : 2 * index + 2, 2 * index : 2 * index + 2] = wall.covariance
    return joint


def solve_position(
    sightings: Sequence[Sighting],
    observed: Float[np.ndarray, "paths kinds"],
    covariance: Float[np.ndarray, "observations observations"],
    walls: Sequence[Wall],
    wall_covariance: Float[np.ndarray, "parameters parameters"],
) -> Consensus:
    """Find the position that explains some paths best.

    Parameters
    ----------
    sightings
        The paths, and the mirrors of each.
    observed
        Of all paths: angle and length, if the clock is known; angle, length and radius of
        curvature, if its offset is to be found as well. [rad], [m]
    covariance
        Of all of them, path after path.
    walls
        All mirrors, at their true place.
    wall_covariance
        Of (angle, offset) of all of them, wall after wall.
    """
    kinds = observed.shape[1]
    unknown_clock = kinds == 3
    rows = np.concatenate([kinds * one.path + np.arange(kinds) for one in sightings])
    values = observed.ravel()[rows]
    first = sightings[0]
    start = _image_folded(observed[first.path], [walls[i] for i in first.chain])
    offset = float(observed[first.path, -1] - observed[first.path, 1]) if unknown_clock else 0.0
    unknowns = np.array([*start, *([offset] if unknown_clock else [])])
    for _ in range(ROUNDS):
        by_walls = _wall_slopes(sightings, unknowns[:2], walls, kinds)
        total = covariance[np.ix_(rows, rows)] + by_walls @ wall_covariance @ by_walls.T
        # Scaled to like units, so that its square root is exact to rounding.
        scale = np.sqrt(np.diag(total))
        root = np.linalg.cholesky(total / np.outer(scale, scale))
        for _ in range(ITERATIONS):
            predicted, slopes = _predicted(sightings, unknowns, walls, kinds)
            left = values - predicted
            angles = np.arange(0, len(left), kinds)
            left[angles] = (left[angles] + np.pi) % (2 * np.pi) - np.pi
            weighted = np.linalg.solve(root, slopes / scale[:, None])
            errors = np.linalg.solve(root, left / scale)
            step = np.linalg.lstsq(weighted, errors)[0]
            unknowns = unknowns + step
            if np.linalg.norm(step) < CONVERGED:
                break
    spread = np.linalg.inv(weighted.T @ weighted)
    square = np.zeros((3, 3))
    square[:2, :2] = spread[:2, :2]
    rest = errors - weighted @ step
    return Consensus(
        sightings=tuple(sightings),
        position=np.append(unknowns[:2], 0.0),
        covariance=square,
        chi_square=float(rest @ rest),
        freedom=len(values) - len(unknowns),
        clock_offset=float(unknowns[2]) / speed_of_light if unknown_clock else None,
        clock_deviation=float(np.sqrt(spread[2, 2])) / speed_of_light if unknown_clock else None,
    )


def _image_folded(
    observed: Float[np.ndarray, " kinds"], chain: Sequence[Wall]
) -> Float[np.ndarray, " 2"]:
    """Fold the image that one path shows back to the user. [m]."""
    place = observed[-1] * np.array([np.cos(observed[0]), np.sin(observed[0]), 0.0])
    for wall in chain:
        place = mirrored(place, wall.start, wall.end)
    folded: np.ndarray = place[:2]
    return folded


def _predicted(
    sightings: Sequence[Sighting],
    unknowns: Float[np.ndarray, " unknowns"],
    walls: Sequence[Wall],
    kinds: int,
) -> tuple[Float[np.ndarray, " observations"], Float[np.ndarray, "observations unknowns"]]:
    """Return what the paths should show, and its slopes."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    points[:, :2] += unknowns[:2]
    offset = float(unknowns[2]) if kinds == 3 else 0.0
    values, slopes = [], []
    for one in sightings:
        images = points
        for index in reversed(one.chain):
            images = mirrored(images, walls[index].start, walls[index].end)
        image, turned = images[0, :2], (images[1:] - images[0])[:, :2]  # mirrors are linear
        length = float(np.linalg.norm(image))
        along = image / length
        by_place = [turned @ [-along[1], along[0]] / length, turned @ along, turned @ along]
        values += [np.arctan2(image[1], image[0]), length - offset, length][:kinds]
        by_clock = [[], [], []] if kinds == 2 else [[0.0], [-1.0], [0.0]]
        slopes += [[*by_place[i], *by_clock[i]] for i in range(kinds)]
    return np.array(values), np.array(slopes)


def _wall_slopes(
    sightings: Sequence[Sighting],
    place: Float[np.ndarray, " 2"],
    walls: Sequence[Wall],
    kinds: int,
) -> Float[np.ndarray, "observations parameters"]:
    """Differentiate what the paths show by (angle, offset) of all walls, the user held."""
    user = np.append(place, 0.0)
    slopes = np.zeros((kinds * len(sightings), 2 * len(walls)))
    for row, one in enumerate(sightings):
        for index in set(one.chain):
            for column, unit in enumerate(STEP * np.eye(2)):
                ends = []
                for sign in (1.0, -1.0):
                    shifted = list(walls)
                    shifted[index] = walls[index].moved(
                        tilt=float(sign * unit[0]), offset=float(sign * unit[1])
                    )
                    image = user
                    for back in reversed(one.chain):
                        image = mirrored(image, shifted[back].start, shifted[back].end)
                    length = float(np.linalg.norm(image))
                    ends.append(np.array([np.arctan2(image[1], image[0]), length, length]))
                change = (ends[0] - ends[1])[:kinds] / (2 * STEP)
                slopes[kinds * row : kinds * (row + 1), 2 * index + column] = change
    return slopes
