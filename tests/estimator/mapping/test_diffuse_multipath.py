"""Where diffuse echoes over a rough mirror appear, against their own lengths."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_2d import mirrored
from estimator.mapping.diffuse_multipath import between, in_cloud, without_scattered_twice
from estimator.walls.fitted_line import FittedLine

RESOLUTION = Resolution(along_ray=2e-3, across_ray=4e-3)
WALL = FittedLine(
    start=np.array([-0.14, 0.66, 0.0]),
    end=np.array([0.14, 0.94, 0.0]),
    covariance=np.zeros((2, 2)),
    level=1.0,
    background=1e-3,
    confidence=1.0,
)
TARGET = np.array([0.4, 0.74, 0.0])
GHOST = mirrored(TARGET, WALL.start, WALL.end)


def appears(*ways: np.ndarray) -> np.ndarray:
    """Where an echo appears that goes out over one point of the wall and back over another."""
    lengths = [np.linalg.norm(facet) + np.linalg.norm(facet - TARGET) for facet in ways]
    sine = np.mean([facet[0] / np.linalg.norm(facet) for facet in ways])
    return np.asarray(np.mean(lengths) * np.array([sine, np.sqrt(1 - sine**2), 0.0]))


def on_wall(share: float) -> np.ndarray:
    return np.asarray(WALL.start + share * (WALL.end - WALL.start))


@pytest.mark.parametrize("back", [0.1, 0.35, 0.9])
@pytest.mark.parametrize("out", [0.03, 0.5, 0.77])
def test_diffuse_echoes_are_in_the_cloud_of_their_ghost(out: float, back: float) -> None:
    place = appears(on_wall(out), on_wall(back))
    assert in_cloud(place[None], GHOST, [WALL], RESOLUTION)[0]
    assert np.linalg.norm(place) >= np.linalg.norm(GHOST) - 1e-12  # never nearer


def test_the_specular_way_back_keeps_a_cloud_at_the_ghosts_range() -> None:
    # Where the straight line to the ghost meets the wall y = x + 0.8.
    specular = GHOST * 0.8 / (GHOST[1] - GHOST[0])
    np.testing.assert_allclose(appears(specular, specular), GHOST, atol=1e-12)
    assert in_cloud(appears(specular, on_wall(0.9))[None], GHOST, [WALL], RESOLUTION)[0]


def test_what_is_nearer_or_farther_or_aside_is_no_cloud() -> None:
    ray = GHOST / np.linalg.norm(GHOST)
    aside = np.linalg.norm(GHOST) * np.array([0.3, np.sqrt(1 - 0.09), 0.0])
    points = np.stack([GHOST - 0.01 * ray, GHOST + 0.2 * ray, aside])
    assert not in_cloud(points, GHOST, [WALL], RESOLUTION).any()
    assert not in_cloud(points, GHOST, [], RESOLUTION).any()


def test_one_way_out_and_another_back_appear_between_the_two() -> None:
    direct = np.array([0.2, 0.6, 0.0])
    sine = np.mean([p[0] / np.linalg.norm(p) for p in (direct, GHOST)])
    reach = np.mean([np.linalg.norm(p) for p in (direct, GHOST)])
    mixed = reach * np.array([sine, np.sqrt(1 - sine**2), 0.0])
    points = np.stack([mixed, direct, GHOST, mixed * 1.02])
    assert between(points, direct, GHOST, RESOLUTION).tolist() == [True, False, False, False]


def test_a_line_that_a_wall_makes_by_way_of_a_post_is_no_wall() -> None:
    post = np.array([-0.2, 0.55, 0.0])

    def by_way(share: float) -> np.ndarray:
        # Out to the post, on to a facet and straight back: half the way, and the mean sine.
        facet = on_wall(share)
        ways = [np.linalg.norm(post), np.linalg.norm(facet)]
        sine = 0.5 * (post[0] / ways[0] + facet[0] / ways[1])
        half = 0.5 * (sum(ways) + np.linalg.norm(facet - post))
        return np.asarray(half * np.array([sine, np.sqrt(1 - sine**2), 0.0]))

    twice = replace(WALL, start=by_way(0.1), end=by_way(0.4))
    posts, bright = post[None], np.array([100.0])
    assert without_scattered_twice([WALL, twice], posts, bright, RESOLUTION) == (WALL,)
    # Where the wall reflects the post's echo, the line is as bright as the post.
    flash = replace(twice, level=200.0)
    assert without_scattered_twice([WALL, flash], posts, bright, RESOLUTION) == (WALL,)
    # Without anything as bright there, or a few cells beside, it is a wall.
    assert len(without_scattered_twice([WALL, twice], posts, 1e-3 * bright, RESOLUTION)) == 2
    moved = replace(twice, start=1.03 * twice.start, end=1.03 * twice.end)
    assert without_scattered_twice([WALL, moved], posts, bright, RESOLUTION) == (WALL, moved)


def test_a_steep_wall_seen_on_one_way_over_a_mirror_is_no_wall_where_it_appears() -> None:
    # Its face sends nothing straight back, and is not in the image; its end is.
    end, other = np.array([0.2, 0.75, 0.0]), np.array([0.3, 0.85, 0.0])

    def mixed(facet: np.ndarray) -> np.ndarray:
        image = mirrored(facet, WALL.start, WALL.end)
        sine = np.mean([place[0] / np.linalg.norm(place) for place in (facet, image)])
        reach = np.mean([np.linalg.norm(place) for place in (facet, image)])
        return np.asarray(reach * np.array([sine, np.sqrt(1 - sine**2), 0.0]))

    seen = replace(WALL, start=mixed(other), end=mixed(end), level=0.1)
    points, faint = end[None], np.array([1e-3])
    assert without_scattered_twice([WALL, seen], points, faint, RESOLUTION) == (WALL,)
    # An end of something else, or a mirror that ends before it reflects that end, tells nothing.
    elsewhere = points + np.array([0.03, 0.0, 0.0])
    assert len(without_scattered_twice([WALL, seen], elsewhere, faint, RESOLUTION)) == 2
    short = replace(WALL, start=on_wall(0.0), end=on_wall(0.2))
    assert len(without_scattered_twice([short, seen], points, faint, RESOLUTION)) == 2
