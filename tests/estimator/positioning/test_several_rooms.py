"""One answer from those in several rooms, of which one is the true one."""

import numpy as np
import pytest

from estimator.geometry.bearing_3d import PLANAR
from estimator.positioning.several_rooms import WHERE_WALLS_STAND, over_several_rooms
from estimator.results.estimate import Status, UserEstimate


def at(
    x: float, *, status: Status = "found", probability: float | None = 0.9996, **more: object
) -> UserEstimate:
    return UserEstimate(
        name="ann",
        status=status,
        position=np.array([x, 0.8, 0.1]),
        covariance=np.eye(3) * 1e-4**2,
        line_of_sight=True,
        probability=probability,
        **more,  # type: ignore[arg-type]
    )


NOWHERE = UserEstimate(name="ann", status="not_found", reason="no wave stands out of the pilot")


def test_the_same_place_in_all_rooms_is_found() -> None:
    answer = over_several_rooms([(0.6, at(0.2)), (0.3, at(0.2001))], how=PLANAR)
    assert (answer.status, answer.reason, answer.alternatives) == ("found", None, ())
    assert answer.probability == pytest.approx(0.9996)


def test_places_that_depend_on_the_room_are_weighed_by_the_rooms() -> None:
    answer = over_several_rooms([(0.3, at(-0.4)), (0.6, at(0.2))], how=PLANAR)
    assert (answer.status, answer.reason) == ("ambiguous", WHERE_WALLS_STAND)
    assert answer.position is not None
    assert answer.position[0] == 0.2
    assert answer.probability == pytest.approx(2 / 3, rel=1e-3)
    (other,) = answer.alternatives
    assert other.probability == pytest.approx(1 / 3, rel=1e-3)
    assert other.status == "ambiguous"


def test_an_answer_that_is_open_in_each_room_keeps_its_reason() -> None:
    other = at(0.5, status="ambiguous", probability=0.1)
    is_open = at(0.2, status="ambiguous", probability=0.9, reason="why", alternatives=(other,))
    answer = over_several_rooms([(0.6, is_open), (0.4, is_open)], how=PLANAR)
    assert (answer.status, answer.reason) == ("ambiguous", "why")
    assert answer.probability == pytest.approx(0.9)
    assert [one.probability for one in answer.alternatives] == pytest.approx([0.1])


def test_a_room_without_a_user_takes_its_share_of_certainty() -> None:
    answer = over_several_rooms([(0.9, at(0.2)), (0.1, NOWHERE)], how=PLANAR)
    assert answer.status == "ambiguous"
    assert answer.probability == pytest.approx(0.9, rel=1e-3)


def test_no_user_in_any_room_is_none() -> None:
    assert over_several_rooms([(0.9, NOWHERE), (0.1, NOWHERE)], how=PLANAR) is NOWHERE


def test_places_without_probabilities_share_their_rooms() -> None:
    two = at(0.2, status="ambiguous", probability=None, alternatives=(at(0.6, probability=None),))
    answer = over_several_rooms([(1.0, two)], how=PLANAR)
    assert answer.probability == pytest.approx(0.5)
    assert [one.probability for one in answer.alternatives] == pytest.approx([0.5])
