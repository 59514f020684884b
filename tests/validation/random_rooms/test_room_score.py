"""Scores of answers to random rooms: right, wrong, open, missed, false."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.results.estimate import Estimate, Mirror, Target, UserEstimate
from validation.metrics.truth import Truth
from validation.random_rooms.oracle import Answerable
from validation.random_rooms.room_score import RoomScore, score_room
from validation.random_rooms.room_summary import summarise, table_rows

TRUTH = Truth(
    user_position={"user": np.array([0.1, 0.5, 0.0])},
    wall_start={"wall": np.array([-0.1, 0.4, 0.0])},
    wall_end={"wall": np.array([0.1, 0.4, 0.0])},
    target_position={"post": np.array([0.3, 0.3, 0.0])},
    target_size={"post": np.array([0.01, 0.01, 0.0])},
    target_kind={"post": "cylinder"},
)
ORACLE = Answerable(shown=("wall",), paths=(), answerable=True, why="it can", deviation=1e-4)
MILLIMETRE = np.diag([1e-6, 1e-6, 0.0])


def user(x: float, y: float, **changes: object) -> UserEstimate:
    placed = UserEstimate(
        name="user", status="found", position=np.array([x, y, 0.0]), covariance=MILLIMETRE
    )
    return replace(placed, **changes)  # type: ignore[arg-type]


def mirror(angle: float, confidence: float = 1.0) -> Mirror:
    along = 0.1 * np.array([np.cos(angle), np.sin(angle), 0.0])
    middle = np.array([0.0, 0.4, 0.0])
    return Mirror(
        start=middle - along,
        end=middle + along,
        normal=np.array([np.sin(angle), -np.cos(angle), 0.0]),
        covariance=np.diag([1e-6, 1e-8]),
        confidence=confidence,
        level_db=30.0,
    )


def scored(answer: UserEstimate, *mirrors: Mirror, targets: tuple[Target, ...] = ()) -> RoomScore:
    estimate = Estimate(users=(answer,), mirrors=mirrors, targets=targets)
    return score_room("room", estimate, TRUTH, ORACLE, flat=True, seconds=1.0)


def test_an_answer_is_right_within_its_region_of_999_in_1000_and_wrong_beyond() -> None:
    # χ² with two degrees of freedom: 13.8, which is 3.7 deviations of 1 mm.
    assert scored(user(0.1036, 0.5)).verdict == "right"
    assert scored(user(0.1038, 0.5)).verdict == "wrong"


def test_an_open_answer_holds_the_truth_if_one_of_its_places_does() -> None:
    off = user(0.3, 0.5, status="ambiguous")
    assert scored(off).verdict == "open, truth not among them"
    with_it = replace(off, alternatives=(user(0.1, 0.5, status="ambiguous", probability=0.7),))
    score = scored(with_it)
    assert score.verdict == "open, truth among them"
    assert score.stated == ((0.7, True),)
    assert scored(UserEstimate(name="user", status="not_found")).verdict == "none"


def test_a_turned_mirror_is_false_and_one_along_the_wall_is_found() -> None:
    right, turned = mirror(0.0), mirror(np.radians(40))
    score = scored(user(0.1, 0.5), right, turned, replace(turned, confidence=0.5))
    assert score.found == ("wall",)
    assert (score.false_mirrors, score.doubtful_mirrors) == (1, 1)
    assert score.wall_squares == pytest.approx((0.0,), abs=1e-12)


def test_a_target_is_false_away_from_all_walls_and_bodies() -> None:
    places = ([0.295, 0.3, 0.0], [0.05, 0.401, 0.0], [0.0, 0.2, 0.0])  # post, wall, nothing
    targets = tuple(Target(position=np.array(p), ghost=np.array(p)) for p in places)
    score = scored(user(0.1, 0.5), targets=targets)
    assert (score.targets, score.false_targets, score.targets_on_walls) == (3, 1, 1)


def test_a_summary_counts_what_the_scores_say() -> None:
    scores = (
        scored(user(0.1, 0.5, probability=0.9995), mirror(0.0)),
        scored(user(0.3, 0.5, probability=0.9995)),
        scored(UserEstimate(name="user", status="not_found")),
    )
    summary = summarise(scores)
    assert summary.verdicts["right"] == summary.verdicts["wrong"] == summary.verdicts["none"] == 1
    assert (summary.answered, summary.answerable) == (1, 3)
    assert (summary.walls_found, summary.walls_shown) == (1, 3)
    assert summary.wrong == ("room",)
    assert summary.worst_error == pytest.approx(0.2)
    (stated,) = summary.stated
    assert (stated.right, stated.places, stated.low) == (1, 2, 0.999)
    assert ("found and wrong", "1") in table_rows(summary)


def test_no_scores_are_refused() -> None:
    with pytest.raises(ValueError, match="no rooms"):
        summarise(())


@pytest.mark.parametrize(("turned", "false"), [(0.0, 0), (0.05, 1)])
def test_a_mirror_on_the_face_of_a_box_is_not_false(turned: float, false: int) -> None:
    # The front of a box turned by 20°, 6 cm deep, through the middle of the mirror.
    angle = np.radians(20.0)
    inward = np.array([-np.sin(angle), np.cos(angle), 0.0])
    box = replace(
        TRUTH,
        wall_start={},
        wall_end={},
        target_position={"box": np.array([0.0, 0.4, 0.0]) + 0.03 * inward},
        target_size={"box": np.array([0.24, 0.06, 0.0])},
        target_kind={"box": "box"},
        target_angle={"box": angle},
    )
    estimate = Estimate(users=(user(0.1, 0.5),), mirrors=(mirror(angle + turned),), targets=())
    scored = score_room("room", estimate, box, ORACLE, flat=True, seconds=1.0)
    assert scored.false_mirrors == false
    assert scored.found == (() if false else ("box, face 0",))
