"""Lines whose mean alone stands out of the noise, in closed form."""

from typing import Any

import numpy as np

from estimator.array.linear_array import echo_resolution
from estimator.array.resolution_cell import coarse_resolution
from estimator.imaging.survey_2d import survey
from estimator.walls.faint_lines import find_faint_lines
from estimator.walls.line_detection import LineCandidate
from estimator.walls.wall_detection_2d import detect_mirrors

START, END = np.array([-0.05, 0.2, 0.0]), np.array([0.05, 0.36, 0.0])


def _faint_wall(world: Any, rng: np.random.Generator, snr_db: float) -> Any:
    """Speckle on a line between two strong ends, in noise."""
    shares = rng.random((1500, 1))
    ends = np.concatenate([np.repeat(one[None], 300, axis=0) for one in (START, END)])
    points = np.concatenate([START + shares * (END - START), ends])
    return world.echo(points, rng, snr_db=snr_db)


def test_a_wall_that_no_place_shows_is_found_by_its_mean(world: Any) -> None:
    echo = _faint_wall(world, np.random.default_rng(3), -19.0)
    looked = survey(echo)
    coarse = coarse_resolution(echo_resolution(echo))
    line = find_faint_lines(looked, (), coarse)[0]
    along = (END - START) / np.linalg.norm(END - START)
    normal = np.array([along[1], -along[0], 0.0])
    for tip in (line.start, line.end):
        # Ends are pixels, half a cell apart.
        assert abs(float((tip - START) @ normal)) < float(coarse.cell(tip, normal))
    # What is known already is not found once more.
    known = LineCandidate(start=START, end=END, inliers=0)
    assert not find_faint_lines(looked, [known], coarse)


def test_a_faint_wall_is_a_mirror(world: Any) -> None:
    echo = _faint_wall(world, np.random.default_rng(3), -19.0)
    (wall,) = detect_mirrors(echo, survey(echo))
    turn = np.cross(wall.direction, (END - START) / np.linalg.norm(END - START))[2]
    assert abs(turn) < 4 * np.sqrt(wall.covariance[0, 0])


def test_a_post_before_a_faint_wall_does_not_draw_the_line_to_itself(world: Any) -> None:
    rng = np.random.default_rng(3)
    shares = rng.random((1500, 1))
    ends = np.concatenate([np.repeat(one[None], 300, axis=0) for one in (START, END)])
    # 4 mm aside of the middle, 30 dB above the wall's own places.
    along = (END - START) / np.linalg.norm(END - START)
    post = 0.5 * (START + END) + 0.004 * np.array([along[1], -along[0], 0.0])
    points = [START + shares * (END - START), ends, np.repeat(post[None], 3000, axis=0)]
    echo = world.echo(np.concatenate(points), rng, snr_db=-14.0)
    (wall,) = detect_mirrors(echo, survey(echo))
    turn = np.cross(wall.direction, along)[2]
    assert abs(turn) < 4 * np.sqrt(wall.covariance[0, 0])
    assert abs(float((wall.middle - START) @ wall.normal)) < 1e-3


def test_noise_and_bright_points_have_no_faint_lines(world: Any) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        points = np.column_stack(
            [rng.uniform(-0.1, 0.1, 6), rng.uniform(0.15, 0.4, 6), np.zeros(6)]
        )
        echo = world.echo(points, rng, snr_db=-10.0)
        coarse = coarse_resolution(echo_resolution(echo))
        assert not find_faint_lines(survey(echo), (), coarse)


def test_a_wall_that_is_dark_in_half_of_its_length_is_found(world: Any) -> None:
    # Cells of tens of decibels here, none there: the sides are dark all along.
    rng = np.random.default_rng(5)
    half = START + 0.45 * rng.random((1500, 1)) * (END - START)
    ends = np.concatenate([np.repeat(one[None], 300, axis=0) for one in (START, END)])
    echo = world.echo(np.concatenate([half, ends]), rng, snr_db=-12.0)
    looked, coarse = survey(echo), coarse_resolution(echo_resolution(echo))
    for line in find_faint_lines(looked, (), coarse)[:1]:
        along = (END - START) / np.linalg.norm(END - START)
        assert abs(np.cross(line.end - line.start, along)[2]) < 0.01
        break
    else:
        raise AssertionError("no line")


def test_a_cloud_of_speckle_has_no_faint_lines(world: Any) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        cloud = np.column_stack([rng.uniform(-0.05, 0.05, 4000), rng.uniform(0.2, 0.3, 4000)])
        points = np.column_stack([cloud, np.zeros(len(cloud))])
        echo = world.echo(points, rng, snr_db=20.0)
        coarse = coarse_resolution(echo_resolution(echo))
        assert not find_faint_lines(survey(echo), (), coarse)
