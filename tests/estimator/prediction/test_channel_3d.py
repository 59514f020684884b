"""Channels in space against rays that are followed, and against walls that are moved."""

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.geometry.path_tracing_3d import project_in_space
from estimator.geometry.specular_chains_3d import image_in_space
from estimator.geometry.wall_3d import PlaneWall
from estimator.prediction.channel_3d import PredictedSpacePath, predict_channel_in_space
from estimator.walls.plane_fit import plane_axes

FREQUENCY = 60e9
EXACT = np.zeros((3, 3))
USER = np.array([1.45, 0.6, 0.1])


def square(
    centre: list[float],
    normal: list[float],
    half: float = 0.5,
    covariance: Float[np.ndarray, "3 3"] = EXACT,
) -> PlaneWall:
    axes = plane_axes(np.array(normal) / np.linalg.norm(normal))
    place = np.array(centre)
    corners = place + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ axes
    return PlaneWall(corners=corners, centre=place, axes=axes, covariance=covariance)


FIRST = square([0.0, 1.5, 0.0], [1.0, -1.0, 0.0])
SECOND = square([1.5, 1.5, 0.0], [-1.0, -1.0, 0.0])
FLOOR = square([0.7, 1.0, -0.6], [0.0, 0.0, 1.0], half=1.5)


def over(paths: tuple[PredictedSpacePath, ...], *walls: int) -> PredictedSpacePath:
    (path,) = [one for one in paths if one.walls == walls]
    return path


def test_each_path_ends_at_the_user_after_just_its_walls() -> None:
    walls = [FIRST, SECOND, FLOOR]
    paths = predict_channel_in_space(USER, EXACT, walls, frequency=FREQUENCY)
    assert {path.walls for path in paths} >= {(), (0,), (1,), (2,), (0, 1)}
    for path in paths:
        ray = project_in_space(path.cosines, path.path_length, walls, covariance=EXACT)
        assert ray.walls == path.walls
        np.testing.assert_allclose(ray.position, USER, atol=1e-9)
        np.testing.assert_allclose(path.vertices[-1], USER, atol=1e-9)
        legs = np.linalg.norm(np.diff(path.vertices, axis=0), axis=1)
        assert legs.sum() == pytest.approx(path.path_length)
        assert path.delay == pytest.approx(path.path_length / speed_of_light)
    direct = over(paths)
    far = float(np.linalg.norm(USER))
    assert direct.level_db == pytest.approx(
        20 * np.log10(speed_of_light / FREQUENCY / (4 * np.pi * far))
    )
    assert [path.gain for path in paths] == sorted((path.gain for path in paths), reverse=True)


def test_what_a_wall_hides_and_what_comes_from_behind_is_no_path() -> None:
    screen = square([0.7, 0.3, 0.0], [1.0, 0.3, 0.0], half=0.2)
    alone = predict_channel_in_space(USER, EXACT, [screen], frequency=FREQUENCY)
    assert () not in {path.walls for path in alone}
    behind = np.array([0.2, -1.0, 0.0])
    assert predict_channel_in_space(behind, EXACT, [], frequency=FREQUENCY) == ()
    small = square([0.0, 1.5, 0.0], [1.0, -1.0, 0.0], half=0.05)  # the path passes beside it
    assert (0,) not in {
        path.walls for path in predict_channel_in_space(USER, EXACT, [small], frequency=FREQUENCY)
    }
    few = predict_channel_in_space(USER, EXACT, [FIRST, SECOND], frequency=FREQUENCY, max_bounces=1)
    assert max(len(path.walls) for path in few) == 1


def test_uncertain_walls_and_positions_make_uncertain_paths() -> None:
    rng = np.random.default_rng(1)
    spread = np.diag([1e-6, 4e-6, 9e-6])
    walls = [
        square([0.0, 1.5, 0.0], [1.0, -1.0, 0.0], covariance=np.diag([1e-6, 4e-6, 1e-6])),
        square([1.5, 1.5, 0.0], [-1.0, -1.0, 0.0], covariance=np.diag([2e-6, 1e-6, 4e-6])),
    ]
    path = over(predict_channel_in_space(USER, spread, walls, frequency=FREQUENCY), 0, 1)
    drawn = []
    for _ in range(4000):
        moved = [
            wall.moved(rng.multivariate_normal(np.zeros(3), wall.covariance)) for wall in walls
        ]
        image = image_in_space(rng.multivariate_normal(USER, spread), moved, (0, 1))
        far = np.linalg.norm(image)
        drawn.append([image[0] / far, image[2] / far, far])
    sample = np.cov(np.array(drawn).T)
    # 4000 draws: 2 % of each deviation and correlation, three times that here.
    scale = np.sqrt(np.diag(sample))
    np.testing.assert_allclose(
        path.covariance / np.outer(scale, scale), sample / np.outer(scale, scale), atol=0.07
    )
