"""Chains of mirrors: rays of the image, unfolded."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.path_tracing import project
from estimator.geometry.specular_chains import image_over, seen_over, unfolded
from estimator.geometry.specular_chains_2d import possible_chains
from estimator.geometry.wall_2d import Wall, mirrored

ROUNDING = 1e-12


def wall(start: tuple[float, float], end: tuple[float, float]) -> Wall:
    return Wall(
        start=np.array([*start, 0.0]), end=np.array([*end, 0.0]), covariance=np.zeros((2, 2))
    )


SLANTED = wall((-0.2, 0.6), (0.2, 1.0))  # 45° through (0, 0.8): +y becomes +x
SECOND = wall((0.75, 0.95), (1.05, 0.65))  # −45° through (0.9, 0.8): +x becomes −y
THIRD = wall((0.7, 0.3), (1.1, 0.3))  # lies below: −y becomes +y
ROOM = (SLANTED, SECOND, THIRD)


@pytest.mark.parametrize(
    ("reach", "place", "chain"),
    [
        pytest.param(0.7, (0.0, 0.7), (), id="before the wall"),
        pytest.param(1.0, (0.2, 0.8), (0,), id="over one wall"),
        pytest.param(2.0, (0.9, 0.5), (0, 1), id="over two"),
        pytest.param(2.3, (0.9, 0.4), (0, 1, 2), id="over three"),
        pytest.param(2.8, (0.8, 0.8), (0, 1, 2, 1), id="back over the second"),
    ],
)
def test_what_is_seen_straight_ahead_is_where_the_mirrors_send_the_ray(
    reach: float, place: tuple[float, float], chain: tuple[int, ...]
) -> None:
    places, chains = unfolded(np.array([[0.0, reach, 0.0]]), ROOM)
    np.testing.assert_allclose(places[0, :2], place, atol=ROUNDING)
    assert tuple(i for i in chains[0] if i >= 0) == chain


def test_a_ray_through_a_doorway_is_not_reflected() -> None:
    # The same wall with a gap of 8 cm about the ray straight ahead.
    halves = wall((-0.2, 0.6), (-0.04, 0.76)), wall((0.04, 0.84), (0.2, 1.0))
    places, chains = unfolded(np.array([[0.0, 1.2, 0.0], [-0.12, 1.2, 0.0]]), halves)
    np.testing.assert_array_equal(places[0], [0.0, 1.2, 0.0])
    assert chains[:, 0].tolist() == [-1, 0]


@settings(deadline=None, max_examples=60)
@given(st.floats(1.2, 1.9), st.floats(0.1, 3.0))
def test_the_image_of_the_true_place_is_where_it_was_seen(angle: float, reach: float) -> None:
    seen = reach * np.array([[np.cos(angle), np.sin(angle), 0.0]])
    places, chains = unfolded(seen, ROOM)
    chain = tuple(int(i) for i in chains[0] if i >= 0)
    np.testing.assert_allclose(image_over(places, ROOM, chain), seen, atol=1e-9)
    # A second implementation: the projection of a user's path of that angle and length.
    path = project(LINEAR, np.array([angle]), reach, ROOM, covariance=np.eye(2))
    assert path.walls == chain
    np.testing.assert_allclose(path.position, places[0], atol=1e-9)
    assert seen_over(seen, ROOM, chain)[0]
    assert chain in set(possible_chains(ROOM))


def test_one_wall_makes_one_chain_and_a_wall_behind_it_none_over_it() -> None:
    assert list(possible_chains([SLANTED])) == [(), (0,)]
    behind = wall((-0.3, 1.2), (0.3, 1.8))  # parallel, seen past neither side
    chains = list(possible_chains([SLANTED, behind]))
    assert (0, 1) not in chains  # over the first wall nothing behind it is seen
    assert () in chains
    assert (0,) in chains


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_side_wall_that_reaches_behind_the_array_is_in_chains_on_either_side(
    side: float,
) -> None:
    beside = wall((0.4 * side, -0.3), (0.4 * side, 0.6))
    ahead = wall((-0.3, 0.8), (0.3, 0.8))
    chains = set(possible_chains([beside, ahead]))
    assert {(0,), (1,), (0, 1), (1, 0)} <= chains
    # A user in sight of it, by its image: the ray of its direction meets it.
    image = np.array([0.6 * side, 0.3, 0.0])
    places, met = unfolded(image[None], [beside, ahead])
    assert met[0, 0] == 0
    np.testing.assert_allclose(places[0], [0.2 * side, 0.3, 0.0], atol=ROUNDING)


def test_without_mirrors_everything_is_where_it_is_seen() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (7, 3)) * [1, 1, 0]
    places, chains = unfolded(points, [])
    np.testing.assert_allclose(places, points, atol=ROUNDING)
    assert np.all(chains == -1)
    assert list(possible_chains([])) == [()]
    assert seen_over(points, [], ()).all()


def test_the_brightest_way_is_asked_for_exactly() -> None:
    ghost = np.array([[0.0, 2.0, 0.0]])  # over the first two
    assert not seen_over(ghost, ROOM, ())[0]
    assert not seen_over(ghost, ROOM, (0,))[0]
    assert seen_over(ghost, ROOM, (0, 1))[0]
    np.testing.assert_allclose(
        mirrored(mirrored(ghost, SLANTED.start, SLANTED.end), SECOND.start, SECOND.end),
        unfolded(ghost, ROOM)[0],
        atol=ROUNDING,
    )
