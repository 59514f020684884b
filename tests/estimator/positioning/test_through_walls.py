"""Waves that may have come through a wall, and mirrors that are seen edge-on."""

import numpy as np
import pytest
from scipy.integrate import quad

from estimator.array.resolution_cell import Resolution
from estimator.positioning.level_likelihood import LEAST_DB, MOST_DB, through_density
from estimator.positioning.unseen_mirrors import EDGE_ON_TILT, wall_behind


@pytest.mark.parametrize("frequency", [28e9, 60e9, 250e9])
def test_the_density_of_levels_behind_a_wall_integrates_to_one(frequency: float) -> None:
    lost = -8 / 250 * frequency / 1e9
    mass = quad(through_density, LEAST_DB, MOST_DB, args=(frequency,), points=[lost], limit=200)[0]
    assert mass == pytest.approx(1.0, abs=1e-6)


def test_what_is_nearly_as_strong_as_free_space_came_through_no_wall_at_250_ghz() -> None:
    assert through_density(-1.0, 250e9) < 0.001 * through_density(-20.0, 250e9)
    assert through_density(-3.0, 28e9) == pytest.approx(through_density(-20.0, 28e9))


def test_a_wall_behind_a_point_starts_there_and_runs_on_along_the_line_of_sight() -> None:
    near = np.array([-0.06, 0.4, 0.0])
    wall = wall_behind(near, Resolution(along_ray=2e-3, across_ray=9e-3))
    np.testing.assert_allclose(wall.start, near)
    assert float(np.linalg.norm(np.cross(wall.end, near))) == pytest.approx(0.0, abs=1e-12)
    assert np.sqrt(wall.covariance[0, 0]) == pytest.approx(EDGE_ON_TILT)
    # Turned about its near end, that end stays: its offset varies by the image's cell alone.
    half = 0.5 * float(np.linalg.norm(wall.end - wall.start))
    at_start = np.array([half, 1.0])
    assert np.sqrt(at_start @ wall.covariance @ at_start) < 5e-3
