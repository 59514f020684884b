"""The joint position of several paths, against a least squares that knows walls as unknowns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float
from scipy.optimize import least_squares

from estimator.geometry.wall_2d import Wall, mirrored
from estimator.positioning.weighted_least_squares import Sighting, block_covariance, solve_position

WALL = Wall(
    start=np.array([-0.2, 0.6, 0.0]),
    end=np.array([0.2, 1.0, 0.0]),
    covariance=np.array([[1e-4**2, 0.3e-9], [0.3e-9, 2e-5**2]]),
)
SECOND = Wall(
    start=np.array([0.8, 0.5, 0.0]),
    end=np.array([0.85, 1.1, 0.0]),
    covariance=np.diag([2e-4**2, 3e-5**2]),
)
WALLS = [WALL, SECOND]
USER = np.array([0.5, 0.75, 0.0])
CHAINS = [(), (0,), (0, 1)]
SIGHTINGS = [Sighting(path=index, chain=chain) for index, chain in enumerate(CHAINS)]
DEVIATIONS = np.array([1e-4, 5e-5, 1e-2])


def seen(
    user: Float[np.ndarray, " 3"], shifts: Float[np.ndarray, " 4"], offset: float, kinds: int
) -> Float[np.ndarray, "paths kinds"]:
    """Angle, length and radius of each path, with walls turned and moved."""
    moved = [
        wall.moved(tilt=float(shifts[2 * i]), offset=float(shifts[2 * i + 1]))
        for i, wall in enumerate(WALLS)
    ]
    rows = []
    for chain in CHAINS:
        image = user
        for index in chain[::-1]:
            image = mirrored(image, moved[index].start, moved[index].end)
        length = float(np.hypot(image[0], image[1]))
        rows.append([np.arctan2(image[1], image[0]), length - offset, length][:kinds])
    return np.array(rows)


@pytest.mark.parametrize("kinds", [2, 3])
def test_it_is_the_least_squares_over_position_clock_and_walls(kinds: int) -> None:
    rng = np.random.default_rng(3)
    clock = 0.1 if kinds == 3 else 0.0
    deviations = DEVIATIONS[:kinds]
    walls = block_covariance(WALLS)
    truth = seen(USER, rng.multivariate_normal(np.zeros(4), walls), clock, kinds)
    observed = truth + deviations * rng.standard_normal(truth.shape)
    covariance = np.diag(np.tile(deviations**2, 3))
    found = solve_position(SIGHTINGS, observed, covariance, WALLS, walls)
    root = np.linalg.inv(np.linalg.cholesky(walls))

    def left(x: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, " errors"]:
        predicted = seen(np.array([x[0], x[1], 0.0]), x[2:6] * 1e-4, float(x[6:].sum()), kinds)
        errors = (observed - predicted) / deviations
        return np.concatenate([errors.ravel(), root @ x[2:6] * 1e-4])

    start = np.array([*USER[:2], 0, 0, 0, 0, *([clock] if kinds == 3 else [])])
    full = least_squares(left, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    # The walls' errors enter to first order: products of 1e-4 with 1e-4 are left out.
    np.testing.assert_allclose(found.position[:2], full.x[:2], atol=3e-7)
    jacobian = np.asarray(full.jac)
    covariances = np.linalg.inv(jacobian.T @ jacobian)[:2, :2]
    np.testing.assert_allclose(found.covariance[:2, :2], covariances, rtol=0, atol=
                               2e-3 * np.trace(covariances))  # fmt: skip
    assert found.chi_square == pytest.approx(2 * full.cost, rel=2e-2)
    assert found.freedom == 3 * kinds - 2 - (kinds == 3)
    assert found.agrees


@settings(deadline=None, max_examples=20)
@given(x=st.floats(0.3, 0.7), y=st.floats(0.5, 0.9), clock=st.floats(-0.3, 0.3))
def test_exact_paths_give_the_user_and_its_clock(x: float, y: float, clock: float) -> None:
    user = np.array([x, y, 0.0])
    observed = seen(user, np.zeros(4), clock, 3)
    covariance = np.diag(np.tile(DEVIATIONS**2, 3))
    found = solve_position(SIGHTINGS, observed, covariance, WALLS, block_covariance(WALLS))
    np.testing.assert_allclose(found.position, user, atol=1e-9)
    assert found.clock_offset == pytest.approx(clock / 299792458, abs=1e-17)
    assert found.chi_square <= 1e-6


def test_two_paths_over_one_wall_share_its_error() -> None:
    # Were they independent, a second path as good as the first would halve the variance; the
    # wall's error is common to both, and stays.
    sure = np.diag(np.tile(np.array([1e-7, 1e-7]) ** 2, 2))
    observed = seen(USER, np.zeros(4), 0.0, 2)[[1, 1]]
    one = solve_position(
        [Sighting(path=0, chain=(0,))], observed, sure, WALLS, block_covariance(WALLS)
    )
    two = solve_position(
        [Sighting(path=0, chain=(0,)), Sighting(path=1, chain=(0,))],
        observed, sure, WALLS, block_covariance(WALLS),
    )  # fmt: skip
    assert np.trace(two.covariance) == pytest.approx(np.trace(one.covariance), rel=1e-3)


def test_paths_that_contradict_each_other_do_not_agree() -> None:
    observed = seen(USER, np.zeros(4), 0.0, 2)
    observed[1, 1] += 1e-3  # twenty deviations
    covariance = np.diag(np.tile(DEVIATIONS[:2] ** 2, 3))
    found = solve_position(SIGHTINGS[:2], observed, covariance, WALLS, block_covariance(WALLS))
    assert not found.agrees
    # One path alone always agrees with itself.
    assert solve_position(
        SIGHTINGS[1:2], observed, covariance, WALLS, block_covariance(WALLS)
    ).agrees
