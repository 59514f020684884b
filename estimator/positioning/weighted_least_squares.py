r"""One position from several paths: joint least squares over bearings, delays and curvatures.

A path over the mirrors of a chain shows the user's image p = A u + t: the user u mirrored about
each of them, the last one first. The path's bearing (an angle in the plane, two cosines in space)
is that of p, its length |p|, and so is the radius of its wavefront; a user's clock that is ahead
by δ makes all lengths seem shorter by cδ:

.. math:: b = b(p), \qquad R = |p| - c \delta, \qquad \kappa = 1 / |p| .

Walls are uncertain too: with their parameters' covariance :math:`C_w` and the observations'
slopes H over these, errors of all paths have the covariance :math:`C + H C_w H^T`. Paths over
one wall share its errors, so they do not average them out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator import false_alarm
from estimator.compute.distributions import chi_square_quantile
from estimator.geometry.bearing import Bearing
from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.path_tracing import slopes_by_wall
from estimator.geometry.specular_chains import Chain, image_over, unfolded_over

ROUNDS = 2
"""How often the walls' part of the covariance is taken at the place found. [-]."""
ITERATIONS = 20
"""Most Gauss-Newton steps. :data:`CONVERGED` ends what converges, near the place after a handful;
what does not leaves a χ² that the test of agreement refuses. [-]"""
CONVERGED = 1e-12
"""Step that ends an iteration: far below a wavelength, above float64's rounding of metres. [m]"""
AGREE = 1 - false_alarm.DISAGREEMENT
"""Probability with which true paths pass the test that they agree. [-]"""
FLATTEST = 1e-3
"""Least curvature from which a search for a user's place is begun: a kilometre, beyond any room.
[1/m]"""

MOST_CONDITION = 1e7
"""Condition number of the weighted slopes from which a place is not told: its square is what
float64 inverts with two digits left. [-]"""


class UndeterminedPlaceError(ArithmeticError):
    """The observations leave a coordinate, or the clock, open: a plane wave on an unknown clock."""


@dataclass(frozen=True, kw_only=True)
class Sighting:
    """A path that is taken to come over a chain of mirrors."""

    path: int  # its index
    chain: Chain  # of walls, from the array outward


@dataclass(frozen=True, kw_only=True)
class Consensus:
    """Where some paths together put the user."""

    sightings: tuple[Sighting, ...]
    position: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "3 3"]  # [m²]
    chi_square: float  # weighted square of what is left over [-]
    freedom: int  # observations beyond the unknowns
    log_evidence: float
    """Logarithm of the density of what was observed, integrated over all places: of a Gaussian,
    with a prior of 1 for each metre of each coordinate, about the least squares solution."""
    clock_offset: float | None  # of the user; None where it was not solved for [s]
    clock_deviation: float | None  # [s]

    @property
    def agrees(self) -> bool:
        """Whether all paths can be of one user at this position."""
        return self.freedom == 0 or self.chi_square < chi_square_quantile(AGREE, self.freedom)


def solve_position(
    sightings: Sequence[Sighting],
    observed: Float[np.ndarray, "paths kinds"],
    covariance: Float[np.ndarray, "observations observations"],
    walls: Sequence[FlatWall],
    wall_covariance: Float[np.ndarray, "parameters parameters"],
    *,
    how: Bearing,
    clock_known: bool = True,
) -> Consensus:
    """Find the position that explains some paths best.

    Parameters
    ----------
    sightings
        The paths, and the mirrors of each.
    observed
        Of all paths: bearing and length, if the clock is known; bearing, length and curvature, if
        its offset is to be found as well. [rad] or [-], [m], [1/m]
    covariance
        Of all of them, path after path.
    walls
        All mirrors, at their true place.
    wall_covariance
        Of (tilts, offset) of all of them, wall after wall.
    how
        What the array measures of a direction.
    clock_known
        Whether a delay is a length.

    Raises
    ------
    UndeterminedPlaceError
        If the paths leave the place open.
    """
    kinds = observed.shape[1]
    angles = kinds - (1 if clock_known else 2)
    rows = np.concatenate([kinds * one.path + np.arange(kinds) for one in sightings])
    values = observed.ravel()[rows]
    first = sightings[0]
    seen = observed[first.path]
    distance = float(seen[-1]) if clock_known else 1 / max(float(seen[-1]), FLATTEST)
    start = unfolded_over(distance * how.towards(seen[:angles]), walls, first.chain)
    axes = how.coordinates
    unknowns = start[axes]
    farthest = float(np.linalg.norm(unknowns))
    if not clock_known:
        unknowns = np.append(unknowns, distance - seen[angles])
    for _ in range(ROUNDS):
        by_walls = _wall_slopes(sightings, _place(unknowns, axes), walls, how, kinds)
        total = covariance[np.ix_(rows, rows)] + by_walls @ wall_covariance @ by_walls.T
        # Scaled to like units, so that its square root is exact to rounding.
        scale = np.sqrt(np.diag(total))
        root = np.linalg.cholesky(total / np.outer(scale, scale))
        for _ in range(ITERATIONS):
            predicted, slopes = _predicted(sightings, unknowns, walls, how, kinds)
            left = (values - predicted).reshape(-1, kinds)
            left[:, :angles] = how.wrapped(left[:, :angles])
            weighted = np.linalg.solve(root, slopes / scale[:, None])
            errors = np.linalg.solve(root, left.ravel() / scale)
            step = np.linalg.lstsq(weighted, errors)[0]
            # Far from the solution the linear model overshoots: the step is limited to the
            # distance.
            step = step / max(1.0, float(np.linalg.norm(step[: len(axes)])) / farthest)
            unknowns = unknowns + step
            if np.linalg.norm(step) < CONVERGED:
                break
    if np.linalg.cond(weighted) > MOST_CONDITION:
        raise UndeterminedPlaceError("the paths' bearings, lengths and curvatures do not tell it")
    spread = np.linalg.inv(weighted.T @ weighted)
    square = np.zeros((3, 3))
    square[np.ix_(axes, axes)] = spread[: len(axes), : len(axes)]
    rest = errors - weighted @ step
    return Consensus(
        sightings=tuple(sightings),
        position=_place(unknowns, axes),
        covariance=square,
        chi_square=float(rest @ rest),
        freedom=len(values) - len(unknowns),
        log_evidence=float(
            -0.5 * (rest @ rest)
            - 0.5 * (len(values) - len(unknowns)) * np.log(2 * np.pi)
            - np.log(np.diag(root)).sum()
            - np.log(scale).sum()
            + 0.5 * np.linalg.slogdet(spread)[1]
        ),
        clock_offset=None if clock_known else float(unknowns[-1]) / speed_of_light,
        clock_deviation=None if clock_known else float(np.sqrt(spread[-1, -1])) / speed_of_light,
    )


def _place(unknowns: Float[np.ndarray, " unknowns"], axes: list[int]) -> Float[np.ndarray, " 3"]:
    place = np.zeros(3)
    place[axes] = unknowns[: len(axes)]
    return place


def _predicted(
    sightings: Sequence[Sighting],
    unknowns: Float[np.ndarray, " unknowns"],
    walls: Sequence[FlatWall],
    how: Bearing,
    kinds: int,
) -> tuple[Float[np.ndarray, " observations"], Float[np.ndarray, "observations unknowns"]]:
    """Return what the paths should show, and its slopes."""
    axes = how.coordinates
    place = _place(unknowns, axes)
    points = np.vstack([place, place + np.eye(3)[axes]])
    clock = unknowns[len(axes) :]  # empty, if it is known
    values, slopes = [], []
    for one in sightings:
        images = image_over(points, walls, one.chain)
        image, turned = images[0, axes], (images[1:] - images[0])[:, axes]  # mirrors are linear
        length = float(np.linalg.norm(image))
        ray = image / length
        by_length = turned @ ray
        by_place = [turned @ turn / length for turn in how.turns(ray)]
        by_place += [by_length, -by_length / length**2]
        by_clock = np.zeros((len(by_place), clock.size))
        by_clock[-2:-1] = -1.0
        shown = [*how.of(images[0]), length - float(clock.sum()), 1 / length]
        values += shown[:kinds]
        slopes += [np.append(*both) for both in zip(by_place, by_clock, strict=True)][:kinds]
    return np.array(values), np.array(slopes)


def _wall_slopes(
    sightings: Sequence[Sighting],
    user: Float[np.ndarray, " 3"],
    walls: Sequence[FlatWall],
    how: Bearing,
    kinds: int,
) -> Float[np.ndarray, "observations parameters"]:
    """Differentiate what the paths show by (tilts, offset) of all walls, the user held."""
    ends = np.cumsum([0, *(len(wall.covariance) for wall in walls)])
    slopes = np.zeros((kinds * len(sightings), ends[-1]))
    for row, one in enumerate(sightings):

        def shown(moved: Sequence[FlatWall], chain: Chain = one.chain) -> np.ndarray:
            image = image_over(user, moved, chain)
            length = float(np.linalg.norm(image))
            return np.array([*how.of(image), length, 1 / length])[:kinds]

        for index in set(one.chain):
            columns = slice(ends[index], ends[index + 1])
            slopes[kinds * row : kinds * (row + 1), columns] = slopes_by_wall(shown, walls, index)
    return slopes
