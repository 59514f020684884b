"""Targets in the echoes of points, straight, over a mirror, and over a rough one's facets."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.geometry.wall_2d import mirrored
from estimator.mapping.map_2d import RoomMap, build_room_map
from estimator.measurement.model import Echo

BAND = np.linspace(220e9, 295e9, 301)  # 0.6 m of unambiguous range
WALL = np.array([[-0.1, 0.2, 0.0], [0.1, 0.4, 0.0]])  # 45° through (0, 0.3)
ALONG = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
HIDDEN = np.array([0.2, 0.32, 0.0])


def waves(
    world: Any, lengths: Float[np.ndarray, "waves positions"], strengths: Complex[np.ndarray, " w"]
) -> Complex[np.ndarray, "positions freqs"]:
    """Add up waves of some whole lengths."""
    first = np.exp(-2j * np.pi * BAND[0] / speed_of_light * lengths) * strengths[:, None]
    turn = np.exp(-2j * np.pi * (BAND[1] - BAND[0]) / speed_of_light * lengths)
    samples = np.empty((lengths.shape[1], BAND.size), dtype=np.complex128)
    for column in range(BAND.size):
        samples[:, column] = first.sum(axis=0)
        first *= turn
    return samples


def reach(world: Any, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n positions"]:
    return np.asarray(np.linalg.norm(points[:, None] - world.array(), axis=-1))


def points(
    world: Any, places: Float[np.ndarray, "n 3"], strength: float
) -> Complex[np.ndarray, "m f"]:
    return waves(world, 2 * reach(world, places), np.full(len(places), strength + 0j))


def rough_wall(world: Any, rng: np.random.Generator) -> Complex[np.ndarray, "m f"]:
    places = world.rough_line((0.0, 0.3), 45.0, 0.283, rng, count=900)
    strengths = rng.standard_normal((2, 900))
    return waves(world, 2 * reach(world, places), strengths[0] + 1j * strengths[1])


def mapped(world: Any, samples: Complex[np.ndarray, "m f"], snr_db: float = 20.0) -> RoomMap:
    noisy = world.noisy(samples, snr_db, np.random.default_rng(99))
    return build_room_map(Echo(samples=noisy, positions=world.array(), frequencies=BAND))


def test_a_hidden_post_is_unfolded_to_where_it_stands(world: Any) -> None:
    ghost = mirrored(HIDDEN, WALL[0], WALL[1])
    samples = rough_wall(world, np.random.default_rng(0)) + points(world, ghost[None], 10.0)
    room = mapped(world, samples)
    assert len(room.walls) == 1
    (target,) = room.targets
    assert target.seen_through == (0,)
    assert target.ends is None
    # Half a range cell of 2 mm is a loose bound at this level, as is a tenth of 12 mrad · 0.54 m.
    np.testing.assert_allclose(target.ghost, ghost, atol=6e-4)
    np.testing.assert_allclose(target.position, HIDDEN, atol=1e-3)
    assert target.level_db is not None
    assert target.level_db == pytest.approx(20.0, abs=1.5)  # of an ideal point of strength 10
    assert target.covariance is not None
    away = (target.position - HIDDEN)[:2]
    assert away @ np.linalg.solve(target.covariance[:2, :2], away) <= 25


@pytest.mark.parametrize("seed", range(2))
def test_the_cloud_around_a_ghost_is_no_target_and_no_wall(world: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    ghost = mirrored(HIDDEN, WALL[0], WALL[1])
    facets = WALL[0] + rng.random(500)[:, None] * (WALL[1] - WALL[0])
    single = (
        reach(world, facets)
        + np.linalg.norm(facets - HIDDEN, axis=-1)[:, None]
        + reach(world, ghost[None])
    )
    strengths = (rng.standard_normal((2, 500))).T @ np.array([1.0, 1j])
    # As strong as the ghost in the mean over the samples: 500 facets of variance 2.
    cloud = waves(world, single, strengths) * 10.0 / np.sqrt(1000)
    samples = rough_wall(world, rng) + points(world, ghost[None], 10.0) + cloud
    room = mapped(world, samples)
    assert len(room.walls) == 1
    assert len(room.targets) <= 1
    # Where the cloud's own speckle at the ghost takes it away, nothing is said; never a false one.
    for target in room.targets:
        across = np.array([ghost[1], -ghost[0], 0.0]) / np.linalg.norm(ghost)
        assert abs(np.linalg.norm(target.ghost) - np.linalg.norm(ghost)) < 2e-3  # a cell c/2B
        assert abs((target.ghost - ghost) @ across) < 12e-3 * 0.55  # a cell λ/2D


def test_targets_in_sight_are_told_from_walls_and_from_each_other(world: Any) -> None:
    posts = np.array([[0.08, 0.25, 0.0], [0.12, 0.2, 0.0]])
    samples = rough_wall(world, np.random.default_rng(2)) + points(world, posts, 10.0)
    room = mapped(world, samples)
    assert len(room.walls) == 1
    assert all(target.seen_through == () for target in room.targets)
    found = sorted(target.position[0] for target in room.targets)
    # Half a cell λ/2D: the wall's speckle is as strong in all as either post.
    np.testing.assert_allclose(found, posts[:, 0], atol=2e-3)


def test_one_way_out_and_another_back_make_no_third_target(world: Any) -> None:
    # A post in sight that is seen over the wall too, and the echo that goes one way each.
    post = np.array([0.13, 0.25, 0.0])
    ghost = mirrored(post, WALL[0], WALL[1])
    mixed = reach(world, post[None]) + reach(world, ghost[None])
    samples = (
        rough_wall(world, np.random.default_rng(3))
        + points(world, np.stack([post, ghost]), 10.0)
        + waves(world, mixed, np.array([20.0 + 0j]))
    )
    room = mapped(world, samples)
    (target,) = room.targets  # both views are the same post
    np.testing.assert_allclose(target.position, post, atol=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_no_target(world: Any, seed: int) -> None:
    samples = world.noisy(
        np.full((96, BAND.size), 1e-9 + 0j), 0.0, np.random.default_rng(200 + seed)
    )
    noise = samples - 1e-9
    room = build_room_map(Echo(samples=noise, positions=world.array(), frequencies=BAND))
    assert room.targets == ()
    assert room.walls == ()


def test_a_short_face_is_a_target_with_extents(world: Any) -> None:
    # 4 cm, shorter than the array's 4.75 cm, met at 30° to the ray.
    rng = np.random.default_rng(4)
    face = world.rough_line((0.0, 0.2), 30.0, 0.045, rng, count=300)
    strengths = (rng.standard_normal((2, 300))).T @ np.array([1.0, 1j])
    room = mapped(world, waves(world, 2 * reach(world, face), strengths))
    (target,) = room.targets
    assert target.ends is not None
    along = np.array([np.cos(np.radians(30)), np.sin(np.radians(30)), 0.0])
    length = abs((target.ends[1] - target.ends[0]) @ along)
    assert length == pytest.approx(0.045, abs=6e-3)  # a cell at either end
    np.testing.assert_allclose(target.position, [0, 0.2, 0], atol=4e-3)


def test_a_doorway_parts_a_wall_in_two(world: Any) -> None:
    rng = np.random.default_rng(5)
    parts = [
        world.rough_line(tuple(-0.1 * ALONG[:2] + [0, 0.3]), 45.0, 0.12, rng, count=500),
        world.rough_line(tuple(0.1 * ALONG[:2] + [0, 0.3]), 45.0, 0.12, rng, count=500),
    ]
    strengths = (rng.standard_normal((2, 1000))).T @ np.array([1.0, 1j])
    beyond = np.array([[0.0, 0.5, 0.0]])  # seen through the doorway: it stays where it is
    samples = waves(world, 2 * reach(world, np.concatenate(parts)), strengths)
    room = mapped(world, samples + points(world, beyond, 10.0))
    assert len(room.walls) == 2
    assert room.seen_through == ((), ())
    places = sorted(
        float((end - [0, 0.3, 0]) @ ALONG) for wall in room.walls for end in (wall.start, wall.end)
    )
    np.testing.assert_allclose(places, [-0.16, -0.04, 0.04, 0.16], atol=8e-3)  # two cells
    (target,) = room.targets
    np.testing.assert_allclose(target.position, beyond[0], atol=1e-3)
    assert target.seen_through == ()
