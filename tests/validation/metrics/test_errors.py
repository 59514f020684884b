import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.results.estimate import Mirror
from validation.metrics.errors import (
    error_summary,
    nearest_wall,
    position_error,
    wall_error,
    wall_errors,
)
from validation.metrics.truth import Truth

ROUNDING = 1e-12  # of sums over metres in double precision


def mirror_between(start: tuple[float, float], end: tuple[float, float]) -> Mirror:
    first, last = np.array([*start, 0.0]), np.array([*end, 0.0])
    dx, dy = (last - first)[:2] / np.linalg.norm(last - first)
    normal = np.array([dy, -dx, 0.0])
    return Mirror(
        start=first,
        end=last,
        normal=normal if normal[1] < 0 else -normal,
        covariance=np.eye(2),
        confidence=1.0,
        level_db=20.0,
    )


WALL = np.array([[-0.2, 0.8, 0.0], [0.2, 0.8, 0.0]])


def test_a_mirror_on_the_wall_has_no_error() -> None:
    error = wall_error(mirror_between((-0.2, 0.8), (0.2, 0.8)), "wall", *WALL)
    assert error.angle == pytest.approx(0.0, abs=ROUNDING)
    assert error.offset == pytest.approx(0.0, abs=ROUNDING)
    assert error.covered == pytest.approx(1.0)
    assert error.overhang == pytest.approx(0.0, abs=ROUNDING)


@given(angle=st.floats(-0.5, 0.5), shift=st.floats(-0.05, 0.05), reverse=st.booleans())
def test_a_wall_turned_about_its_centre_and_shifted_shows_that_turn_and_shift(
    angle: float, shift: float, reverse: bool
) -> None:
    along = 0.2 * np.array([np.cos(angle), np.sin(angle)])
    centre = np.array([0.0, 0.8]) + shift * np.array([-np.sin(angle), np.cos(angle)])
    ends = [tuple(centre - along), tuple(centre + along)]
    error = wall_error(mirror_between(*(ends[::-1] if reverse else ends)), "wall", *WALL)
    assert error.angle == pytest.approx(abs(angle), abs=ROUNDING)
    # The plane lies behind the true centre (away from the array) by the shift.
    assert error.offset == pytest.approx(shift, abs=ROUNDING)


def test_a_tiny_angle_is_not_lost_to_rounding() -> None:
    error = wall_error(mirror_between((-0.2, 0.8), (0.2, 0.8 + 0.4e-9)), "wall", *WALL)
    assert error.angle == pytest.approx(1e-9, rel=1e-6)  # 0.8 is rounded to 1e-16


def test_half_a_wall_and_a_piece_beyond_its_end_are_told_apart() -> None:
    error = wall_error(mirror_between((0.0, 0.8), (0.3, 0.8)), "wall", *WALL)
    assert error.covered == pytest.approx(0.5)
    assert error.overhang == pytest.approx(0.1)


def test_each_mirror_is_compared_with_the_wall_it_lies_on() -> None:
    truth = Truth(
        wall_start={"near": WALL[0], "far": np.array([0.7, 0.6, 0.0])},
        wall_end={"near": WALL[1], "far": np.array([0.7, 1.0, 0.0])},
    )
    crossing = mirror_between((0.69, 0.75), (0.7, 0.95))
    errors = wall_errors([crossing, mirror_between((-0.1, 0.79), (0.1, 0.8))], truth)
    assert [error and error.wall for error in errors] == ["far", "near"]


def test_without_a_truth_there_is_nothing_to_compare_with() -> None:
    mirror = mirror_between((-0.2, 0.8), (0.2, 0.8))
    assert nearest_wall(mirror, Truth()) is None
    assert wall_errors([mirror], Truth()) == (None,)
    assert position_error(np.zeros(3), None) is None
    assert position_error(None, np.zeros(3)) is None


def test_the_error_of_a_position_is_its_distance_from_the_truth() -> None:
    assert position_error(np.array([1.0, 2.0, 2.0]), np.zeros(3)) == pytest.approx(3.0)


def test_an_error_that_half_of_all_trials_keep_within_is_the_median() -> None:
    summary = error_summary([0.3, 0.1, 0.2, 0.5, 0.4])
    assert (summary.median, summary.ninth_decile, summary.worst) == (0.3, 0.5, 0.5)
    assert summary.rms == pytest.approx(np.sqrt(0.55 / 5))
    np.testing.assert_allclose(summary.cdf(np.array([0.05, 0.2, 1.0])), [0.0, 0.4, 1.0])


def test_no_answer_counts_as_infinitely_wrong() -> None:
    summary = error_summary([0.1, None, 0.2, None])
    assert summary.missing == 2
    assert summary.median == 0.2
    assert summary.ninth_decile == float("inf")
    assert summary.cdf(np.array([1e9]))[0] == 0.5
    assert np.isnan(error_summary([None]).rms)


def test_no_trials_and_no_distances_are_refused() -> None:
    with pytest.raises(ValueError, match="no trials"):
        error_summary([])
    with pytest.raises(ValueError, match="cannot be negative or NaN"):
        error_summary([0.1, float("nan")])
