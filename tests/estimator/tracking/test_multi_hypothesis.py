"""Tracks of users whose way, outliers and ambiguities are known."""

import numpy as np
import pytest
from jaxtyping import Float
from scipy.stats import chi2

from estimator.results.estimate import UserEstimate
from estimator.tracking.multi_hypothesis import Fix, fix, predicted, track

IN_PLANE = np.diag([1.0, 1.0, 0.0])
DEVIATION = 0.01  # of each coordinate [m]


def fixes_along(
    way: Float[np.ndarray, "times 3"], *, step: float = 0.2, seed: int = 0
) -> list[Fix]:
    rng = np.random.default_rng(seed)
    return [
        Fix(
            time=step * index,
            positions=(place + DEVIATION * rng.standard_normal(3) @ IN_PLANE)[None],
            covariances=(DEVIATION**2 * IN_PLANE)[None],
        )
        for index, place in enumerate(way)
    ]


def walk(count: int = 12, *, step: float = 0.2) -> Float[np.ndarray, "times 3"]:
    times = step * np.arange(count)
    way = np.zeros((count, 3))
    way[:, 0], way[:, 1], way[:, 2] = 0.2 + 0.5 * times, 1.0 + 0.1 * times**2, 1.2
    return way


def elsewhere(one: Fix, x: float, y: float) -> Fix:
    away = np.array([[x, y, 1.2]])
    return Fix(time=one.time, positions=away, covariances=one.covariances)


def within(found: Float[np.ndarray, " 3"], truth: Float[np.ndarray, " 3"]) -> bool:
    """Whether no coordinate of the plane is five raw deviations off."""
    return bool(np.all(np.abs(found - truth)[:2] < 5 * DEVIATION))


def test_a_track_follows_the_user_in_the_plane_of_its_fixes() -> None:
    way = walk()
    found = track(fixes_along(way))
    assert [point.candidate for point in found.points] == [0] * 12
    for point, place in zip(found.points, way, strict=True):
        assert within(point.position, place)
        assert point.position[2] == pytest.approx(1.2, abs=1e-9)
        assert abs(point.velocity[2]) < 1e-9
        assert np.all(np.abs(point.covariance[2]) < 1e-15)
    # Half a second of 1 cm fixes tells the velocity to some cm/s; 0.1 m/s is several deviations.
    np.testing.assert_allclose(found.points[6].velocity[:2], [0.5, 0.24], atol=0.15)
    assert found.rival < 1e-3


def test_a_tilted_plane_holds_the_same_track() -> None:
    turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    flat = fixes_along(walk())
    tilted = [
        Fix(
            time=one.time,
            positions=one.positions @ turn.T,
            covariances=turn @ one.covariances @ turn.T,
        )
        for one in flat
    ]
    for one, other in zip(track(flat).points, track(tilted).points, strict=True):
        np.testing.assert_allclose(other.position, turn @ one.position, atol=1e-9)
        np.testing.assert_allclose(other.velocity, turn @ one.velocity, atol=1e-9)


def test_users_in_space_have_three_coordinates() -> None:
    rng = np.random.default_rng(3)
    way = np.stack([0.3 * np.arange(8.0), np.zeros(8), 0.1 * np.arange(8.0)], axis=1)
    fixes = [
        Fix(
            time=float(index),
            positions=(place + DEVIATION * rng.standard_normal(3))[None],
            covariances=(DEVIATION**2 * np.eye(3))[None],
        )
        for index, place in enumerate(way)
    ]
    last = track(fixes, acceleration=1e-4).points[-1]
    np.testing.assert_allclose(last.velocity, [0.3, 0.0, 0.1], atol=0.03)
    assert np.all(np.linalg.eigvalsh(last.covariance) > 0)


@pytest.mark.parametrize("wrong", [0, 1, 5, 11])
def test_an_outlier_is_dropped_wherever_it_is(wrong: int) -> None:
    way = walk()
    fixes = fixes_along(way)
    fixes[wrong] = elsewhere(fixes[wrong], -1.0, 2.0)
    found = track(fixes)
    # Before the first fix that is believed there is no track.
    assert len(found.points) == (11 if wrong == 0 else 12)
    used = {round(point.time / 0.2): point.candidate for point in found.points}
    assert used.pop(wrong, None) is None
    assert set(used.values()) == {0}
    for point in found.points:
        place = way[round(point.time / 0.2)]
        off = (point.position - place)[:2]
        # As far as the covariance says, one in 1e6; the way itself is one of the model's.
        assert off @ np.linalg.solve(point.covariance[:2, :2], off) < chi2.ppf(1 - 1e-6, df=2)


def test_the_track_tells_which_of_several_answers_is_the_user() -> None:
    way = walk()
    fixes = fixes_along(way)
    ghosts = walk() * [-1.0, 1.0, 1.0] + [0.0, 0.8, 0.0]  # over a wall that is not there
    rng = np.random.default_rng(1)
    swapped = []
    for index, ghost in enumerate(ghosts):
        if index in (0, 4, 5, 9):
            jump = ghost + np.array([0.3 * (-1) ** index, 0.0, 0.0])  # it does not move smoothly
            own = fixes[index]
            order = [1, 0] if rng.random() < 0.7 else [0, 1]
            fixes[index] = Fix(
                time=own.time,
                positions=np.stack([own.positions[0], jump])[order],
                covariances=np.repeat(own.covariances, 2, axis=0),
            )
            swapped.append((index, order.index(0)))
    found = track(fixes)
    assert len(found.points) == 12
    assert {right for _, right in swapped} == {0, 1}  # both orders occurred
    for index, right in swapped:
        assert found.points[index].candidate == right
    for point, place in zip(found.points, way, strict=True):
        assert within(point.position, place)


def test_two_equal_ways_are_rivals() -> None:
    fixes = [
        Fix(
            time=one.time,
            positions=np.concatenate([one.positions, one.positions * [-1.0, 1.0, 1.0]]),
            covariances=np.repeat(one.covariances, 2, axis=0),
        )
        for one in fixes_along(walk())
    ]
    assert track(fixes).rival == pytest.approx(1.0, rel=1e-6)  # the mirror image is as likely


def test_a_gap_without_answers_is_bridged_and_less_certain() -> None:
    way = walk()
    fixes = fixes_along(way)
    for index in (5, 6, 7):
        fixes[index] = Fix(
            time=fixes[index].time, positions=np.zeros((0, 3)), covariances=np.zeros((0, 3, 3))
        )
    found = track(fixes)
    assert [point.candidate for point in found.points[5:8]] == [None] * 3
    spread = [np.trace(point.covariance[:3, :3]) for point in found.points]
    assert spread[6] > spread[5] > spread[4]
    assert spread[6] > spread[7] > spread[8]
    ahead = [np.trace(point.covariance[:3, :3]) for point in found.filtered]
    assert ahead[7] > ahead[6] > ahead[5] > spread[6] / 2
    off = (found.points[6].position - way[6])[:2]
    expected = found.points[6].covariance[:2, :2]
    assert off @ np.linalg.solve(expected, off) < chi2.ppf(1 - 1e-6, df=2)


def test_what_all_fixes_err_together_does_not_average_out() -> None:
    still = np.tile([0.3, 1.0, 0.0], (60, 1))
    fixes = fixes_along(still)
    shared = 0.5 * DEVIATION**2 * IN_PLANE
    apart = track(fixes, acceleration=1e-9).points[30].covariance[0, 0]
    together = track(fixes, acceleration=1e-9, common=shared).points[30].covariance[0, 0]
    assert together > shared[0, 0]
    # Of 60 fixes a straight way keeps 1/60 in its middle, of what is independent.
    assert apart == pytest.approx(DEVIATION**2 / 60, rel=0.05)
    assert together - shared[0, 0] == pytest.approx(0.5 * DEVIATION**2 / 60, rel=0.05)


def test_the_next_position_is_predicted_with_its_growing_covariance() -> None:
    found = track(fixes_along(walk()))
    last = found.filtered[-1]
    ahead = predicted(found, last.time + 0.5)
    np.testing.assert_allclose(ahead.position, last.position + 0.5 * last.velocity)
    assert ahead.position[2] == pytest.approx(1.2)
    # A fix without an answer at that time gives the same.
    silent = Fix(time=ahead.time, positions=np.zeros((0, 3)), covariances=np.zeros((0, 3, 3)))
    same = track([*fixes_along(walk()), silent]).filtered[-1]
    np.testing.assert_allclose(ahead.covariance, same.covariance, atol=1e-12)
    np.testing.assert_allclose(ahead.position, same.position, atol=1e-12)
    with pytest.raises(ValueError, match="before the track's end"):
        predicted(found, 0.0)


def test_without_any_answer_there_is_no_track() -> None:
    nobody = fix(0.0, UserEstimate(name="ann", status="not_found", reason="no wave"))
    assert nobody.positions.shape == (0, 3)
    empty = track([nobody])
    assert empty.points == ()
    assert track([]).points == ()
    with pytest.raises(ValueError, match="empty"):
        predicted(empty, 1.0)


def test_an_ambiguous_answer_brings_its_alternatives() -> None:
    other = UserEstimate(
        name="ann", status="ambiguous", position=np.ones(3), covariance=2 * IN_PLANE
    )
    answer = UserEstimate(
        name="ann",
        status="ambiguous",
        position=np.zeros(3),
        covariance=IN_PLANE,
        alternatives=(other,),
    )
    one = fix(3.0, answer)
    np.testing.assert_array_equal(one.positions, [[0, 0, 0], [1, 1, 1]])
    np.testing.assert_array_equal(one.covariances[1], 2 * IN_PLANE)
    assert one.time == 3.0


def test_what_cannot_be_tracked_is_refused() -> None:
    fixes = fixes_along(walk(3))
    with pytest.raises(ValueError, match="order of time"):
        track(fixes[::-1])
    with pytest.raises(ValueError, match="acceleration = 0; it must be above 0"):
        track(fixes, acceleration=0.0)
    with pytest.raises(ValueError, match="speed = -1; it must be above 0"):
        track(fixes, speed=-1.0)
    with pytest.raises(ValueError, match="gate = 1; it must lie between 0 and 1"):
        track(fixes, gate=1.0)
    with pytest.raises(ValueError, match="common"):
        track(fixes, common=2 * DEVIATION**2 * IN_PLANE)
    risen = Fix(
        time=9.0,
        positions=fixes[0].positions + np.array([0.0, 0.0, 0.1]),
        covariances=fixes[0].covariances,
    )
    with pytest.raises(ValueError, match="one plane"):
        track([*fixes, risen])
