"""Waves that may have come through a wall, and mirrors that are seen edge-on."""

import numpy as np
import pytest
from scipy.integrate import quad

from estimator.array.resolution_cell import Resolution
from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.bearing_3d import PLANAR
from estimator.geometry.wall_2d import Wall
from estimator.geometry.wall_3d import PlaneWall
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
    wall = wall_behind(near, Resolution(along_ray=2e-3, across_ray=9e-3), LINEAR)
    assert isinstance(wall, Wall)
    np.testing.assert_allclose(wall.start, near)
    assert float(np.linalg.norm(np.cross(wall.end, near))) == pytest.approx(0.0, abs=1e-12)
    assert np.sqrt(wall.covariance[0, 0]) == pytest.approx(EDGE_ON_TILT)
    # Turned about its near end, that end stays: its offset varies by the image's cell alone.
    half = 0.5 * float(np.linalg.norm(wall.end - wall.start))
    at_start = np.array([half, 1.0])
    assert np.sqrt(at_start @ wall.covariance @ at_start) < 5e-3


def test_in_space_such_a_wall_stands_as_upright_as_its_edge_can() -> None:
    near = np.array([-0.06, 0.4, 0.1])
    wall = wall_behind(near, Resolution(along_ray=2e-3, across_ray=9e-3), PLANAR)
    assert isinstance(wall, PlaneWall)
    assert abs(float(near @ wall.normal)) < 1e-12  # edge-on
    edge = wall.corners[3] - wall.corners[0]
    assert abs(float(edge @ near)) < 1e-12  # met at a right angle at its foot
    np.testing.assert_allclose(0.5 * (wall.corners[0] + wall.corners[3]), near)
    assert abs(float(np.cross(edge, near)[2])) < 1e-12  # in the upright plane of the ray
    half = float(np.linalg.norm(wall.centre - near))
    # The near end rises by the offset less the tilt's over half of the wall.
    at_start = np.array([-half, 0.0, 1.0])
    assert np.sqrt(at_start @ wall.covariance @ at_start) < 5e-3
    assert np.sqrt(np.diag(wall.covariance)[:2]) == pytest.approx(EDGE_ON_TILT)
