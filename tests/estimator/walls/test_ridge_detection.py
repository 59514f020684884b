"""Ridges in the survey of random points, in closed form."""

from typing import Any

import numpy as np
import pytest

from estimator.array.linear_array import echo_resolution
from estimator.array.resolution_cell import coarse_resolution
from estimator.imaging.survey_2d import survey
from estimator.walls.ridge_detection import find_ridges


@pytest.mark.parametrize(("angle_deg", "length"), [(8.0, 0.08), (-20.0, 0.06), (60.0, 0.05)])
def test_a_short_wall_is_a_ridge(angle_deg: float, length: float, world: Any) -> None:
    rng = np.random.default_rng(4)
    echo = world.echo(world.rough_line((0.0, 0.28), angle_deg, length, rng), rng)
    looked = survey(echo)
    coarse = coarse_resolution(echo_resolution(echo))
    ridge = find_ridges(looked, np.ones(len(looked.peaks), dtype=bool), coarse)[0]
    along = ridge.end - ridge.start
    turned = np.radians(angle_deg) - np.arctan2(along[1], along[0])
    # Its ends are peaks of the survey on the line, known to half a cell.
    cell = float(
        coarse.cell(ridge.start, np.array([-along[1], along[0], 0]) / np.hypot(*along[:2]))
    )
    assert abs(np.sin(turned)) < cell / np.linalg.norm(along)
    assert np.linalg.norm(along) > 0.6 * length


def test_points_apart_are_no_ridge(world: Any) -> None:
    rng = np.random.default_rng(5)
    points = np.array([[x, y, 0.0] for x, y in [(-0.06, 0.2), (0.05, 0.24), (0.0, 0.32)]])
    echo = world.echo(points, rng)
    looked = survey(echo)
    coarse = coarse_resolution(echo_resolution(echo))
    usable = np.ones(len(looked.peaks), dtype=bool)
    for ridge in find_ridges(looked, usable, coarse):
        # The nearest two of them are 88 mm apart.
        assert np.linalg.norm(ridge.end - ridge.start) < 0.08
