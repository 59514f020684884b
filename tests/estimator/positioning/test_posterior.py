"""What levels, first arrivals and chance agreements say about how a path came."""

import numpy as np
import pytest
from scipy.integrate import quad

from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.wall_2d import Wall
from estimator.positioning.level_likelihood import (
    BLOCKED,
    ISOTROPIC,
    LEAST_DB,
    MOST_DB,
    level_density,
    told_excess_db,
)
from estimator.positioning.weighted_least_squares import Sighting, solve_position


@pytest.mark.parametrize("reflections", [0, 1, 2])
def test_the_density_of_levels_integrates_to_one_or_to_what_is_heard_without_an_earlier_path(
    reflections: int,
) -> None:
    def mass(first: bool) -> float:
        def density(excess: float) -> float:
            return level_density(excess, reflections, first=first)

        # The bounded part is counted over its own range, the Gaussian one far beyond it.
        inside = quad(density, LEAST_DB, MOST_DB, points=[-12.0, -6.0, 0.0], limit=400)[0]
        return float(inside)

    assert mass(first=False) == pytest.approx(1.0, abs=1e-4)
    blocked = 1 - ISOTROPIC * (1 - BLOCKED) if reflections else 1.0
    assert mass(first=True) == pytest.approx(blocked, abs=1e-4)


def test_at_the_level_of_free_space_a_path_is_direct_and_well_below_it_is_a_reflected_one() -> None:
    # One mirror in ten is smooth metal, a fifth of mirrored users are not heard before: a
    # fiftieth, and what an antenna with a gain adds to both.
    assert 30 < level_density(0.0, 0) / level_density(0.0, 1) < 50
    assert 5 < level_density(0.0, 0) / level_density(0.0, 1, first=False) < 10
    # With nothing in the way of an isotropic user, only an antenna with a gain is left.
    free = level_density(0.0, 1, blocked=0.0)
    assert free == pytest.approx((1 - ISOTROPIC) / (MOST_DB - LEAST_DB))
    # A tilt that no mirror has leaves smooth metal.
    flat = level_density(0.0, 1, first=False, tilted=0.0)
    assert level_density(0.0, 0) == pytest.approx(10 * flat, rel=0.01)
    assert level_density(-6.0, 1, first=False) > 5 * level_density(-6.0, 0, first=False)


def test_a_level_above_free_space_tells_of_an_antenna_and_not_of_mirrors() -> None:
    assert told_excess_db(40.0) is None
    assert told_excess_db(-3.0) == -3.0


def test_the_evidence_of_one_path_is_one_over_the_jacobian_of_polar_coordinates() -> None:
    # One bearing and one length fix a place: ∫ N(z; z(u), S) du = |∂u/∂z| = L, whatever S is.
    for spread in (1e-4, 1e-3):
        solved = solve_position(
            [Sighting(path=0, chain=())],
            np.array([[1.2, 0.7]]),
            np.diag([spread**2, (2 * spread) ** 2]),
            (),
            np.zeros((0, 0)),
            how=LINEAR,
        )
        assert solved.log_evidence == pytest.approx(np.log(0.7), abs=1e-6)


def test_two_paths_that_agree_are_evidence_that_grows_as_their_errors_fall() -> None:
    wall = Wall(
        start=np.array([-0.2, 0.8, 0.0]),
        end=np.array([0.4, 0.8, 0.0]),
        covariance=np.diag([1e-12, 1e-14]),
    )
    user = np.array([0.1, 0.4, 0.0])
    seen = np.array([[*LINEAR.of(p), np.linalg.norm(p)] for p in (user, wall.mirrored(user))])

    def evidence(spread: float) -> float:
        return solve_position(
            [Sighting(path=0, chain=()), Sighting(path=1, chain=(0,))],
            seen,
            spread**2 * np.eye(4),
            (wall,),
            wall.covariance,
            how=LINEAR,
        ).log_evidence

    # Two observations more than unknowns: the density of their agreement grows as 1/spread².
    assert evidence(1e-4) - evidence(1e-3) == pytest.approx(2 * np.log(10), rel=0.01)
