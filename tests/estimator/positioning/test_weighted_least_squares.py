"""The joint position of several paths, against a least squares that knows walls as unknowns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float
from scipy.optimize import least_squares

from estimator.geometry.bearing import Bearing
from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.bearing_3d import PLANAR
from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.wall_2d import Wall
from estimator.geometry.wall_3d import PlaneWall
from estimator.positioning.map_context import block_covariance
from estimator.positioning.weighted_least_squares import (
    Consensus,
    Sighting,
    UndeterminedPlaceError,
    solve_position,
)
from estimator.walls.plane_fit import plane_axes

FLAT: list[FlatWall] = [
    Wall(
        start=np.array([-0.2, 0.6, 0.0]),
        end=np.array([0.2, 1.0, 0.0]),
        covariance=np.array([[1e-4**2, 0.3e-9], [0.3e-9, 2e-5**2]]),
    ),
    Wall(
        start=np.array([0.8, 0.5, 0.0]),
        end=np.array([0.85, 1.1, 0.0]),
        covariance=np.diag([2e-4**2, 3e-5**2]),
    ),
]


def plane(centre: list[float], normal: list[float], deviations: list[float]) -> PlaneWall:
    axes = plane_axes(np.array(normal) / np.linalg.norm(normal))
    square = 0.3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return PlaneWall(
        corners=np.array(centre) + square @ axes,
        centre=np.array(centre),
        axes=axes,
        covariance=np.diag(deviations) ** 2,
    )


UPRIGHT: list[FlatWall] = [
    plane([0.0, 0.8, 0.0], [1.0, -1.0, 0.2], [1e-4, 2e-4, 2e-5]),
    plane([0.82, 0.8, 0.0], [-1.0, 0.1, 0.0], [2e-4, 1e-4, 3e-5]),
]
ROOMS: dict[str, tuple[Bearing, list[FlatWall], Float[np.ndarray, " 3"]]] = {
    "plane": (LINEAR, FLAT, np.array([0.5, 0.75, 0.0])),
    "space": (PLANAR, UPRIGHT, np.array([0.5, 0.75, 0.1])),
}
CHAINS = [(), (0,), (0, 1)]
SIGHTINGS = [Sighting(path=index, chain=chain) for index, chain in enumerate(CHAINS)]

both = pytest.mark.parametrize("kind", sorted(ROOMS))


def deviations(how: Bearing, clock_known: bool) -> Float[np.ndarray, " kinds"]:
    angles = [1e-4] * (len(how.coordinates) - 1)
    return np.array([*angles, 5e-5, *([] if clock_known else [1e-2])])


def seen(
    kind: str, user: Float[np.ndarray, " 3"], shifts: np.ndarray, offset: float, clock_known: bool
) -> Float[np.ndarray, "paths kinds"]:
    """Bearing, length and curvature of each path, with walls turned and moved."""
    how, walls, _ = ROOMS[kind]
    size = len(how.coordinates)
    moved = [wall.moved(shifts[size * i : size * (i + 1)]) for i, wall in enumerate(walls)]
    rows = []
    for chain in CHAINS:
        image = user
        for index in chain[::-1]:
            image = moved[index].mirrored(image)
        length = float(np.linalg.norm(image))
        rows.append([*how.of(image), length - offset, *([] if clock_known else [1 / length])])
    return np.array(rows)


def solved(
    kind: str, observed: np.ndarray, clock_known: bool, sightings: list[Sighting] = SIGHTINGS
) -> Consensus:
    how, walls, _ = ROOMS[kind]
    covariance = np.diag(np.tile(deviations(how, clock_known) ** 2, len(observed)))
    return solve_position(
        sightings,
        observed,
        covariance,
        walls,
        block_covariance(walls),
        how=how,
        clock_known=clock_known,
    )


@both
@pytest.mark.parametrize("clock_known", [True, False])
def test_it_is_the_least_squares_over_position_clock_and_walls(
    kind: str, clock_known: bool
) -> None:
    rng = np.random.default_rng(3)
    how, walls, user = ROOMS[kind]
    clock = 0.0 if clock_known else 0.1
    joint = block_covariance(walls)
    size, axes = len(joint), how.coordinates
    truth = seen(kind, user, rng.multivariate_normal(np.zeros(size), joint), clock, clock_known)
    spread = deviations(how, clock_known)
    observed = truth + spread * rng.standard_normal(truth.shape)
    found = solved(kind, observed, clock_known)
    root = np.linalg.inv(np.linalg.cholesky(joint))

    def left(x: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, " errors"]:
        place = np.zeros(3)
        place[axes] = x[: len(axes)]
        shifts = 1e-4 * x[len(axes) : len(axes) + size]
        predicted = seen(kind, place, shifts, float(x[len(axes) + size :].sum()), clock_known)
        return np.concatenate([((observed - predicted) / spread).ravel(), root @ shifts])

    start = np.array([*user[axes], *np.zeros(size), *([] if clock_known else [clock])])
    full = least_squares(left, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    # The walls' errors enter to first order: products of 1e-4 with 1e-4 are left out.
    np.testing.assert_allclose(found.position[axes], full.x[: len(axes)], atol=3e-7)
    jacobian = np.asarray(full.jac)
    covariances = np.linalg.inv(jacobian.T @ jacobian)[: len(axes), : len(axes)]
    np.testing.assert_allclose(
        found.covariance[np.ix_(axes, axes)], covariances, rtol=0, atol=2e-3 * np.trace(covariances)
    )
    assert found.chi_square == pytest.approx(2 * full.cost, rel=2e-2)
    assert found.freedom == observed.size - len(axes) - (not clock_known)
    assert found.agrees


@both
@settings(deadline=None, max_examples=20)
@given(x=st.floats(0.3, 0.7), y=st.floats(0.5, 0.9), clock=st.floats(-0.3, 0.3))
def test_exact_paths_give_the_user_and_its_clock(
    kind: str, x: float, y: float, clock: float
) -> None:
    _, walls, user = ROOMS[kind]
    user = np.array([x, y, user[2]])
    observed = seen(kind, user, np.zeros(len(block_covariance(walls))), clock, False)
    found = solved(kind, observed, False)
    np.testing.assert_allclose(found.position, user, atol=1e-9)
    assert found.clock_offset == pytest.approx(clock / 299792458, abs=1e-17)
    assert found.chi_square <= 1e-6


@both
@pytest.mark.parametrize("error", [-0.6, 3.0])
def test_a_poor_start_from_a_poor_curvature_ends_at_the_user(kind: str, error: float) -> None:
    # The first path's curvature is known to 1/m only: its source looks 0.6 m, or 1000 m, away.
    how, walls, user = ROOMS[kind]
    observed = seen(kind, user, np.zeros(len(block_covariance(walls))), 0.1, False)
    observed[0, -1] = max(observed[0, -1] - error, 1e-3)
    spread = np.tile(deviations(how, False) ** 2, len(observed))
    spread[len(how.coordinates)] = 3.0**2
    found = solve_position(
        SIGHTINGS,
        observed,
        np.diag(spread),
        walls,
        block_covariance(walls),
        how=how,
        clock_known=False,
    )
    assert found.agrees
    # The curvature pulls by its error over its variance: nothing beside the others' millimetre.
    np.testing.assert_allclose(found.position, user, atol=1e-3)


@both
def test_two_paths_over_one_wall_share_its_error(kind: str) -> None:
    # Were they independent, a second path as good as the first would halve the variance; the
    # wall's error is common to both, and stays.
    how, walls, user = ROOMS[kind]
    joint = block_covariance(walls)
    observed = seen(kind, user, np.zeros(len(joint)), 0.0, True)[[1, 1]]
    sure = 1e-14 * np.eye(observed.size)
    twice = [Sighting(path=0, chain=(0,)), Sighting(path=1, chain=(0,))]
    one, two = (
        solve_position(sightings, observed, sure, walls, joint, how=how)
        for sightings in (twice[:1], twice)
    )
    assert np.trace(two.covariance) == pytest.approx(np.trace(one.covariance), rel=1e-3)


@both
def test_paths_that_contradict_each_other_do_not_agree(kind: str) -> None:
    _, walls, user = ROOMS[kind]
    observed = seen(kind, user, np.zeros(len(block_covariance(walls))), 0.0, True)
    observed[1, -1] += 1e-3  # twenty deviations
    assert not solved(kind, observed, True, SIGHTINGS[:2]).agrees
    # One path alone always agrees with itself.
    assert solved(kind, observed, True, SIGHTINGS[1:2]).agrees


def test_a_plane_wave_on_an_unknown_clock_tells_no_place() -> None:
    how, walls, _ = ROOMS["plane"]
    # Curvature 1e-9/m ± 1e-2/m: distance and clock are one and the same unknown.
    with pytest.raises(UndeterminedPlaceError, match="do not tell it"):
        solve_position(
            [Sighting(path=0, chain=())],
            np.array([[1.2, 0.5, 1e-9]]),
            np.diag(deviations(how, False) ** 2),
            walls,
            block_covariance(walls),
            how=how,
            clock_known=False,
        )
