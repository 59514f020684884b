import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.geometry.bearing_3d import PLANAR
from estimator.geometry.path_tracing import project
from estimator.geometry.wall_3d import PlaneWall, hidden_by, mirrored_about, within
from estimator.walls.plane_fit import plane_axes


def wall(
    centre: tuple[float, float, float],
    normal: tuple[float, float, float],
    half: float = 0.5,
    covariance: np.ndarray | None = None,
) -> PlaneWall:
    unit = np.array(normal) / np.linalg.norm(normal)
    axes = plane_axes(unit)
    square = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return PlaneWall(
        corners=np.array(centre) + square @ axes,
        centre=np.array(centre),
        axes=axes,
        covariance=np.zeros((3, 3)) if covariance is None else covariance,
    )


def seen_at(place: np.ndarray) -> tuple[np.ndarray, float]:
    length = float(np.linalg.norm(place))
    return PLANAR.of(place), length


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
@settings(max_examples=25)
def test_the_image_of_an_image_in_space_is_the_point_itself(
    a: float, b: float, x: float, z: float
) -> None:
    mirror = wall((0.1, 1.0, 0.0), (a, -1.0, b))
    point = np.array([x, 0.5, z])
    twice = mirrored_about(mirrored_about(point, mirror), mirror)
    np.testing.assert_allclose(twice, point, atol=1e-12)
    middle = 0.5 * (point + mirrored_about(point, mirror))
    assert abs((middle - mirror.centre) @ mirror.normal) < 1e-12


def test_a_path_over_one_and_two_walls_ends_at_the_user() -> None:
    first = wall((0.0, 1.5, 0.0), (0.6, -1.0, 0.1))
    second = wall((1.0, 1.0, 0.1), (-1.0, -0.2, 0.0), half=0.6)
    user = np.array([0.5, 0.9, 0.05])
    image = mirrored_about(user, first)
    cosines, length = seen_at(image)
    found = project(PLANAR, cosines, length, [first], covariance=np.zeros((3, 3)))
    assert found.walls == (0,)
    np.testing.assert_allclose(found.position, user, atol=1e-12)
    # Over two walls: the user's image in the second, then in the first.
    user = np.array([0.45, 0.6, 0.05])
    cosines, length = seen_at(mirrored_about(mirrored_about(user, second), first))
    found = project(PLANAR, cosines, length, [first, second], covariance=np.zeros((3, 3)))
    assert found.walls == (0, 1)
    np.testing.assert_allclose(found.position, user, atol=1e-12)
    legs = np.linalg.norm(np.diff(found.path, axis=0), axis=1)
    assert abs(legs.sum() - length) < 1e-12


def test_the_first_order_covariance_is_that_of_drawn_walls_and_paths() -> None:
    rng = np.random.default_rng(0)
    spread = np.diag([1e-3, 2e-3, 1e-3]) ** 2
    mirror = wall((0.0, 1.5, 0.0), (0.6, -1.0, 0.1), covariance=spread)
    noise = np.diag([5e-4, 1e-3, 2e-3]) ** 2
    cosines, length = seen_at(mirrored_about(np.array([0.5, 0.9, 0.05]), mirror))
    claimed = project(PLANAR, cosines, length, [mirror], covariance=noise).covariance
    ends = []
    for _ in range(300):
        moved = mirror.moved(rng.multivariate_normal(np.zeros(3), spread))
        drawn = rng.multivariate_normal([*cosines, length], noise)
        ends.append(
            project(PLANAR, drawn[:2], drawn[2], [moved], covariance=np.zeros((3, 3))).position
        )
    # A covariance over n draws scatters by √(2/n) of itself: 8 %; four deviations.
    drawn_covariance = np.cov(np.array(ends).T)
    scale = np.sqrt(np.outer(np.diag(claimed), np.diag(claimed)))
    np.testing.assert_allclose(drawn_covariance / scale, claimed / scale, atol=4 * np.sqrt(2 / 300))


def test_a_wall_hides_what_is_behind_it_and_within_its_outline() -> None:
    mirror = wall((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), half=0.2)
    points = np.array([[0.0, 2.0, 0.0], [0.0, 0.5, 0.0], [0.5, 2.0, 0.0], [0.0, -2.0, 0.0]])
    np.testing.assert_array_equal(hidden_by(points, mirror), [True, False, False, False])
    on_rim = mirror.centre + np.array([[0.21, 0.0, 0.0]])
    assert not within(on_rim, mirror)[0]
    assert within(on_rim, mirror, margin=0.02)[0]


def test_a_tilted_wall_rises_by_its_slope() -> None:
    mirror = wall((0.0, 1.0, 0.0), (0.0, -1.0, 0.0))
    moved = mirror.moved(np.array([0.01, 0.0, 0.002]))
    rise = (moved.corners - mirror.corners) @ mirror.normal
    expected = (mirror.corners - mirror.centre) @ mirror.axes[0] * 0.01 + 0.002
    np.testing.assert_allclose(rise, expected, atol=1e-12)
    # The turned normal is across the moved corners.
    np.testing.assert_allclose((moved.corners - moved.centre) @ moved.normal, 0.0, atol=1e-12)
