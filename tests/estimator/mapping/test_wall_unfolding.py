"""Lines of the image, unfolded over each other to walls."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.specular_chains import image_over
from estimator.geometry.wall_2d import Wall, mirrored
from estimator.geometry.wall_covariance import place_covariance
from estimator.mapping.wall_unfolding import confidence_of, unfold_lines, unfold_seen_lines
from estimator.walls.fitted_line import FittedLine

RESOLUTION = Resolution(along_ray=2e-3, across_ray=4e-3)
DEVIATIONS = np.array([2e-4, 3e-5])  # of angle [rad] and offset [m]
FIRST = np.array([[-0.2, 0.6, 0.0], [0.2, 1.0, 0.0]])
SECOND = np.array([[0.75, 0.95, 0.0], [1.05, 0.65, 0.0]])
THIRD = np.array([[0.7, 0.3, 0.0], [1.1, 0.3, 0.0]])


def line(ends: Float[np.ndarray, "2 3"], **changes: Any) -> FittedLine:
    return FittedLine(
        **{
            "start": ends[0],
            "end": ends[1],
            "covariance": np.diag(DEVIATIONS**2),
            "level": 1.0,
            "background": 1e-3,
            "confidence": 1.0,
            **changes,
        }
    )


def wall(ends: Float[np.ndarray, "2 3"]) -> Wall:
    return Wall(start=ends[0], end=ends[1], covariance=np.zeros((2, 2)))


TRUE = [wall(FIRST), wall(SECOND), wall(THIRD)]
LINES = (
    line(FIRST),
    line(image_over(SECOND, TRUE, (0,))),
    line(image_over(THIRD, TRUE, (0, 1))),
)


def test_walls_behind_walls_are_unfolded_one_after_the_other() -> None:
    for order in ((0, 1, 2), (2, 1, 0), (1, 2, 0)):
        unfolded = unfold_lines([LINES[i] for i in order], RESOLUTION)
        assert unfolded.seen_through == ((), (0,), (0, 1))
        for found, true in zip(unfolded.walls, TRUE, strict=True):
            np.testing.assert_allclose(found.start, true.start, atol=1e-12)
            np.testing.assert_allclose(found.end, true.end, atol=1e-12)


def test_another_view_of_a_known_wall_is_no_second_one() -> None:
    inside = np.array([[0.2, 0.4, 0.0], [0.35, 0.65, 0.0]])  # seen directly and over the first
    again = line(image_over(inside + 1e-3, TRUE, (0,)))  # half a cell off
    unfolded = unfold_lines([line(FIRST), line(inside), again], RESOLUTION)
    assert len(unfolded.walls) == 2
    assert unfolded.seen_through == ((), ())


@pytest.mark.parametrize("direct", ["seen", "not seen"])
def test_what_goes_out_over_a_mirror_and_comes_back_directly_is_no_wall(direct: str) -> None:
    inside = np.array([[0.45, 0.5, 0.0], [0.45, 0.75, 0.0]])  # seen directly and over the first
    over = image_over(inside, TRUE, (0,))
    # Half of its way and the mean of its directions' sines, for either end of the wall.
    ways = np.linalg.norm(np.stack([inside, over]), axis=-1)
    ranges = ways.mean(axis=0)
    sines = (np.stack([inside, over])[..., 0] / ways).mean(axis=0)
    halfway = np.stack([ranges * sines, ranges * np.sqrt(1 - sines**2), np.zeros(2)], axis=-1)
    lines = [line(FIRST), line(over), line(halfway, level=0.5)]
    if direct == "seen":
        lines.append(line(inside, level=0.5))
    unfolded = unfold_seen_lines(lines, RESOLUTION)
    assert len(unfolded.walls) == 2
    np.testing.assert_allclose(unfolded.walls[0].start, FIRST[0])
    np.testing.assert_allclose(unfolded.walls[1].start, inside[0], atol=1e-12)
    # A wall just beside that place stays.
    stays = halfway + np.array([0.08, 0.0, 0.0])
    assert len(unfold_seen_lines([*lines, line(stays)], RESOLUTION).walls) == 3


def test_a_line_beside_a_mirror_is_seen_directly() -> None:
    aside = np.array([[0.4, 0.7, 0.0], [0.5, 0.5, 0.0]])
    unfolded = unfold_lines([line(FIRST), line(aside, level=4.0)], RESOLUTION)
    assert unfolded.seen_through == ((), ())
    np.testing.assert_array_equal(unfolded.walls[0].start, aside[0])  # the strongest first


def test_nothing_is_unfolded_from_nothing() -> None:
    unfolded = unfold_lines([], RESOLUTION)
    assert unfolded.walls == ()
    assert unfolded.covariance.shape == (0, 0)


def test_an_unfolded_wall_errs_with_its_mirrors() -> None:
    unfolded = unfold_lines(LINES, RESOLUTION)
    # In closed form: a mirror's error of angle turns what is unfolded twice. Each line errs by
    # itself, so the angle's variances add up, the mirrors' four times.
    variances = [DEVIATIONS[0] ** 2 * (1 + 4 * before) for before in range(3)]
    found = np.diag(unfolded.covariance)[::2]
    assert found[0] == pytest.approx(variances[0], rel=1e-6)
    assert found[1] == pytest.approx(variances[1], rel=1e-6)
    for index, one in enumerate(unfolded.walls):
        block = unfolded.covariance[2 * index : 2 * index + 2, 2 * index : 2 * index + 2]
        np.testing.assert_array_equal(one.covariance, block)
    # Against draws of all the lines' errors.
    rng = np.random.default_rng(1)
    draws = []
    for _ in range(200):
        shaken = []
        for fitted in LINES:
            tilt, offset = DEVIATIONS * rng.standard_normal(2)
            seen = Wall(start=fitted.start, end=fitted.end, covariance=fitted.covariance)
            moved = seen.moved(np.array([tilt, offset]))
            shaken.append(line(np.stack([moved.start, moved.end])))
        row = []
        for new, old in zip(unfold_lines(shaken, RESOLUTION).walls, unfolded.walls, strict=True):
            along = (old.end - old.start) / np.linalg.norm(old.end - old.start)
            turned = (new.end - new.start) / np.linalg.norm(new.end - new.start)
            normal = np.array([along[1], -along[0], 0.0])
            row += [
                along[0] * turned[1] - along[1] * turned[0],
                (new.start + new.end - old.start - old.end) @ normal / 2,
            ]
        draws.append(row)
    drawn = np.cov(np.array(draws).T)
    deviations = np.sqrt(np.diag(unfolded.covariance))
    scale = np.outer(deviations, deviations)
    # A covariance of 200 draws is known to 1/√200 of the deviations' product, or √2 of it.
    stated = unfolded.covariance / scale
    np.testing.assert_allclose(drawn / scale, stated, atol=4 * np.sqrt(2 / 200))


def test_an_unfolded_place_errs_with_the_mirrors_and_with_its_ghost() -> None:
    unfolded = unfold_lines(LINES[:1], RESOLUTION)
    target = np.array([0.5, 0.8, 0.0])
    ghost = mirrored(target, FIRST[0], FIRST[1])
    own = np.diag([1e-8, 4e-8, 0.0])
    found = place_covariance(ghost, own, unfolded.walls, unfolded.covariance, (0,))
    # 45°: what was across is along. The place is 0.5 m off the wall's midpoint, at 45° to it:
    # turned twice by the angle's error, moved twice by the offset's along the normal.
    normal, along = np.array([1.0, -1.0]) / np.sqrt(2), np.array([1.0, 1.0]) / np.sqrt(2)
    depth, place = 0.5 / np.sqrt(2), 0.5 / np.sqrt(2)
    shift = 4 * DEVIATIONS[1] ** 2 * np.outer(normal, normal)
    lever = place * normal - depth * along
    turn = 4 * DEVIATIONS[0] ** 2 * np.outer(lever, lever)
    np.testing.assert_allclose(
        found[:2, :2], np.diag([4e-8, 1e-8]) + shift + turn, rtol=1e-5, atol=1e-14
    )
    np.testing.assert_array_equal(
        place_covariance(ghost, own, unfolded.walls, unfolded.covariance, ()), own
    )


def test_what_cannot_be_a_reflection_is_seen_through_a_pane() -> None:
    pane = np.array([[-0.236, 0.198, 0.0], [-0.048, 0.338, 0.0]])
    behind = np.array([[-0.305, 0.393, 0.0], [-0.104, 0.487, 0.0]])
    # Unfolded, it would stand across the array's view of the pane itself.
    unfolded = unfold_lines([line(pane), line(behind)], RESOLUTION)
    assert len(unfolded.walls) == 1
    np.testing.assert_allclose(unfolded.walls[0].start, pane[0])
    # A reflection of what stands beside the view of the mirror is one.
    beside = np.array([[-0.3, 0.05, 0.0], [-0.22, 0.12, 0.0]])
    seen = line(image_over(beside, [wall(pane)], (0,)))
    assert len(unfold_lines([line(pane), seen], RESOLUTION).walls) == 2


def test_a_wall_seen_in_mirrors_only_is_never_certain() -> None:
    assert confidence_of(1.0, ()) == 1.0
    assert confidence_of(1.0, (0,)) <= 0.9
    assert confidence_of(0.3, (0, 1)) == 0.3
