"""Users and mirrors from path lists, against rooms by an image method of another hand."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.measurement.model import Measurement, MeasurementError, PathList
from estimator.path_consensus.consensus import MOST_PLACES, PathListAnswer, locate_path_lists
from validation.trials.path_lists import DrawnPaths, SounderErrors, drawn_paths

EXACT = SounderErrors(angle=np.radians(0.1), delay=0.02e-9, level_db=0.1, missed=0.0, scattered=0.0)
FEET = 0.3  # [m], of a wall: five deviations of angles of 2° seen from a few metres


def _feet(answer: PathListAnswer) -> np.ndarray:
    return np.array([(one.start @ one.normal) * one.normal for one in answer.mirrors])


def _far_off(answer: PathListAnswer, drawn: DrawnPaths) -> list[float]:
    """Distances of found users from the truth, over their deviations."""
    off = []
    for user, truth in zip(answer.users, drawn.users, strict=True):
        if user.status == "found":
            assert user.position is not None
            assert user.covariance is not None
            apart, axes = user.position - truth, np.diag(user.covariance) > 0
            square = np.linalg.solve(user.covariance[np.ix_(axes, axes)], apart[axes])
            off.append(float(np.sqrt(apart[axes] @ square)))
    return off


@pytest.mark.parametrize("space", [False, True])
def test_a_walk_in_an_open_room_gives_its_users_and_its_walls(space: bool) -> None:
    drawn = drawn_paths(np.random.default_rng(7001), "open", space=space)
    answer = locate_path_lists(drawn.lists, clock_offset=0.0)
    off = _far_off(answer, drawn)
    assert len(off) > 0.8 * len(drawn.lists)
    assert max(off) < 5  # deviations, of some twenty users
    true = drawn.offsets[:, None] * drawn.normals
    assert len(answer.mirrors) >= 3
    for foot in _feet(answer):
        assert np.linalg.norm(true - foot, axis=1).min() < FEET


def test_an_unknown_clock_is_found_with_the_room() -> None:
    drawn = drawn_paths(
        np.random.default_rng(7004), "open", space=False, clock_offset=12.5e-9, errors=EXACT
    )
    answer = locate_path_lists(drawn.lists, clock_offset=None)
    found = [user for user in answer.users if user.status == "found"]
    assert found
    for user in found:
        assert user.clock_offset is not None
        assert user.clock_deviation is not None
        assert abs(user.clock_offset - 12.5e-9) < 5 * user.clock_deviation
        assert user.clock_deviation < 0.1e-9
    assert max(_far_off(answer, drawn)) < 5


def test_what_is_seen_in_one_mirror_only_is_left_open() -> None:
    for seed in range(2):
        drawn = drawn_paths(np.random.default_rng([7100, seed]), "mirrored", space=False)
        answer = locate_path_lists(drawn.lists, clock_offset=0.0)
        assert not [user for user in answer.users if user.status == "found"]
        assert all(mirror.confidence < 0.99 for mirror in answer.mirrors)


def test_levels_that_are_not_calibrated_leave_all_open_and_say_so() -> None:
    drawn = drawn_paths(np.random.default_rng(7001), "open", space=False, calibrated=False)
    answer = locate_path_lists(drawn.lists, clock_offset=0.0)
    assert {user.status for user in answer.users} == {"ambiguous"}
    assert all("frequency_ghz" in (user.reason or "") for user in answer.users)
    middle = np.median(
        [
            np.linalg.norm(user.position - truth)
            for user, truth in zip(answer.users, drawn.users, strict=True)
            if user.position is not None
        ]
    )
    assert middle < 0.3  # the place is right nevertheless: a deviation of 2° at some metres


def test_one_place_proves_no_mirror() -> None:
    drawn = drawn_paths(np.random.default_rng(7001), "open", space=False)
    answer = locate_path_lists(drawn.lists[:1], clock_offset=0.0)
    assert answer.users[0].status == "ambiguous"
    assert "no mirror is agreed on" in (answer.users[0].reason or "")


def test_a_turned_sounder_turns_the_answer() -> None:
    drawn = drawn_paths(np.random.default_rng(7002), "open", space=False, errors=EXACT)
    plain = locate_path_lists(drawn.lists, clock_offset=0.0)
    turned = locate_path_lists(
        [replace(one, azimuth=one.azimuth + 1.0) for one in drawn.lists], clock_offset=0.0
    )
    turn = np.array([[np.cos(1), -np.sin(1), 0], [np.sin(1), np.cos(1), 0], [0, 0, 1]])
    for one, other in zip(plain.users, turned.users, strict=True):
        assert one.status == other.status
        if one.position is not None and other.position is not None:
            np.testing.assert_allclose(turn @ one.position, other.position, atol=1e-3)


def test_errors_larger_than_told_are_noticed() -> None:
    drawn = drawn_paths(np.random.default_rng(7001), "open", space=False)
    lists = [replace(one, angle_deviation=one.angle_deviation / 6) for one in drawn.lists[:8]]
    answer = locate_path_lists(lists, clock_offset=0.0)
    assert all(user.status != "found" for user in answer.users)


def test_more_places_than_are_solved_together_are_refused() -> None:
    one = PathList(
        user="a",
        azimuth=np.array([1.0]),
        delay=np.array([1e-8]),
        angle_deviation=0.01,
        delay_deviation=1e-10,
    )
    with pytest.raises(MeasurementError, match=f"201 places, more than {MOST_PLACES}"):
        locate_path_lists([one] * 201, clock_offset=0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"delay": np.array([1e-8, 2e-8])}, "2 values of delay for 1 of azimuth"),
        ({"azimuth": np.array([np.nan])}, "1 of 1 values of azimuth are NaN"),
        ({"elevation": np.array([2.0])}, "is beyond 90°; is it counted from the zenith"),
        ({"angle_deviation": 0.0}, "angle_deviation = 0; it must be positive"),
        ({"azimuth": np.zeros(0), "delay": np.zeros(0)}, "0 paths; a list has 1 to 1000"),
    ],
)
def test_lists_that_no_method_could_use_are_refused(
    change: dict[str, object], message: str
) -> None:
    given: dict[str, object] = {
        "user": "a",
        "azimuth": np.array([1.0]),
        "delay": np.array([1e-8]),
        "angle_deviation": 0.01,
        "delay_deviation": 1e-10,
    }
    with pytest.raises(MeasurementError, match=message):
        PathList(**(given | change))  # type: ignore[arg-type]


def test_two_users_of_one_name_are_refused() -> None:
    one = PathList(
        user="a",
        azimuth=np.array([1.0]),
        delay=np.array([1e-8]),
        angle_deviation=0.01,
        delay_deviation=1e-10,
    )
    with pytest.raises(MeasurementError, match="two users are called 'a'"):
        Measurement(echo=None, uplinks=(), path_lists=(one, one))
