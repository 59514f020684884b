from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from jaxtyping import Float

from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.path_tracing import Projection, project
from estimator.geometry.specular_chains import LONGEST_CHAIN
from estimator.geometry.wall_2d import Wall, crossing, mirrored

NOTHING = np.zeros((2, 2))
COORDINATE = st.floats(-2.0, 2.0)


def wall(
    start: tuple[float, float],
    end: tuple[float, float],
    covariance: Float[np.ndarray, "2 2"] = NOTHING,
) -> Wall:
    return Wall(start=np.array([*start, 0.0]), end=np.array([*end, 0.0]), covariance=covariance)


def launched(aoa_deg: float, length: float, walls: list[Wall]) -> Projection:
    return project(LINEAR, np.radians([aoa_deg]), length, walls, covariance=NOTHING)


SLANTED = wall((-0.2, 0.6), (0.2, 1.0))  # through (0, 0.8) at 45°, as in the thesis
MIRROR = wall((-1.0, 0.8), (1.0, 0.8))


@settings(deadline=None, max_examples=50)
@given(*[COORDINATE] * 6)
def test_the_image_of_an_image_is_the_point_itself(
    x: float, y: float, x0: float, y0: float, x1: float, y1: float
) -> None:
    assume(np.hypot(x1 - x0, y1 - y0) > 1e-3)
    point, start, end = (np.array([a, b, 0.3]) for a, b in ((x, y), (x0, y0), (x1, y1)))
    image = mirrored(point, start, end)
    np.testing.assert_allclose(mirrored(image, start, end), point, atol=1e-12)
    np.testing.assert_allclose(mirrored(point, end, start), image, atol=1e-12)
    # The line is in the middle between both, and the height stays.
    for foot in (start, end):
        assert np.linalg.norm(image - foot) == pytest.approx(np.linalg.norm(point - foot))
    assert image[2] == 0.3


def test_many_points_are_mirrored_at_once() -> None:
    points = np.array([[[1.0, 0.0, 0.0], [0.0, 2.0, 1.0]]])
    images = mirrored(points, np.zeros(3), np.array([1.0, 1.0, 0.0]))
    np.testing.assert_allclose(images, [[[0, 1, 0], [2, 0, 1]]], atol=1e-15)


@settings(deadline=None, max_examples=50)
@given(angle_deg=st.floats(-85, 85), aoa_deg=st.floats(40, 140), behind=st.floats(0.05, 2.0))
def test_folding_is_the_thesis_rotation_about_the_point_where_the_ray_meets_the_wall(
    angle_deg: float, aoa_deg: float, behind: float
) -> None:
    # Thesis: rotate what lies behind the wall by 180° − 2θ about the hit, with θ the angle of
    # incidence from the normal. That turns the ray's direction d into d − 2(d·n)n.
    along = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    ray = np.array([np.cos(np.radians(aoa_deg)), np.sin(np.radians(aoa_deg))])
    hit = 0.8 * ray
    normal = np.array([along[1], -along[0]])
    normal = normal * np.sign(-ray @ normal or 1.0)  # towards the array
    towards = ray[0] * normal[1] - ray[1] * normal[0]
    incidence = float(np.arctan2(abs(towards), -ray @ normal))
    assume(incidence < np.radians(89))
    mirror = wall(tuple(hit - 0.3 * along), tuple(hit + 0.3 * along))
    found = launched(aoa_deg, 0.8 + behind, [mirror])
    assert found.walls == (0,)
    # It turns from the ray towards the wall's normal, on the shorter way.
    turn = np.copysign(np.pi - 2 * incidence, towards)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    straight_on = (0.8 + behind) * ray
    expected = hit + rotation @ (straight_on - hit)
    np.testing.assert_allclose(found.position[:2], expected, atol=1e-9)
    np.testing.assert_allclose(found.path[1, :2], hit, atol=1e-12)


def test_the_thesis_user_is_found_over_its_wall() -> None:
    found = launched(90.0, 1.8, [SLANTED])
    np.testing.assert_allclose(found.position, [1.0, 0.8, 0.0], atol=1e-12)
    expected = np.array([[0.0, 0.0, 0.0], [0.0, 0.8, 0.0], [1.0, 0.8, 0.0]])
    np.testing.assert_allclose(found.path, expected, atol=1e-12)
    assert found.margin == pytest.approx(0.2 * np.sqrt(2))


def test_a_ray_that_meets_no_wall_ends_straight_ahead() -> None:
    beside = wall((0.1, 0.5), (0.4, 0.5))
    for walls in ([], [beside]):
        found = launched(120.0, 1.5, walls)
        np.testing.assert_allclose(found.position, [-0.75, 1.5 * np.sqrt(0.75), 0], atol=1e-12)
        assert found.walls == ()
        assert found.margin == np.inf
        assert len(found.path) == 2


def test_a_ray_ends_before_a_wall_or_just_behind_it() -> None:
    assert launched(90.0, 0.79, [MIRROR]).walls == ()
    over = launched(90.0, 0.81, [MIRROR])
    assert over.walls == (0,)
    np.testing.assert_allclose(over.position, [0, 0.79, 0], atol=1e-12)


def test_a_wall_reflects_up_to_its_very_ends_and_tells_how_near_they_are() -> None:
    short = wall((0.0, 0.8), (0.3, 0.8))
    inside = launched(np.degrees(np.arctan2(0.8, 1e-3)), 1.5, [short])
    assert inside.walls == (0,)
    assert inside.margin == pytest.approx(1e-3)
    assert launched(np.degrees(np.arctan2(0.8, -1e-3)), 1.5, [short]).walls == ()
    assert launched(90.0, 1.5, [short]).walls == (0,)


def test_the_nearer_of_two_walls_reflects_whatever_their_order() -> None:
    far = wall((-1.0, 1.2), (1.0, 1.2))
    for walls, near in (([MIRROR, far], 0), ([far, MIRROR], 1)):
        found = launched(90.0, 1.0, walls)
        assert found.walls == (near,)
        np.testing.assert_allclose(found.position, [0, 0.6, 0], atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(
    first_deg=st.floats(30, 60),
    second_deg=st.floats(-60, -30),
    offset=st.floats(-0.05, 0.05),
    x=st.floats(0.6, 1.0),
)
def test_over_two_walls_the_path_is_that_of_the_image_of_the_image(
    first_deg: float, second_deg: float, offset: float, x: float
) -> None:
    def plate(centre: tuple[float, float], angle_deg: float) -> Wall:
        half = 0.35 * np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
        middle = np.array(centre)
        return wall(tuple(middle - half), tuple(middle + half))

    walls = [plate((0.9, 0.8), second_deg), plate((offset, 0.8), first_deg)]
    user = np.array([x, -0.28, 0.0])
    # Seen by the array: the user's image in the last wall, and of that in the first.
    image = mirrored(user, walls[0].start, walls[0].end)
    image = mirrored(image, walls[1].start, walls[1].end)
    length = float(np.linalg.norm(image))
    found = project(LINEAR, LINEAR.of(image), length, walls, covariance=NOTHING)
    assume(found.walls == (1, 0))  # the legs hit both walls within their extent
    np.testing.assert_allclose(found.position, user, atol=1e-9)
    # The path's pieces add up to its length, and each bounce lies on its wall.
    assert np.linalg.norm(np.diff(found.path, axis=0), axis=-1).sum() == pytest.approx(length)
    for vertex, index in zip(found.path[1:-1], found.walls, strict=True):
        margin = np.linalg.norm(vertex - walls[index].start) + np.linalg.norm(
            vertex - walls[index].end
        )
        assert margin == pytest.approx(0.7)


def test_the_case_of_two_walls_does_occur() -> None:
    walls = [wall((-0.14, 0.66), (0.14, 0.94)), wall((0.79, 0.91), (1.01, 0.69))]
    found = launched(90.0, 2.78, walls)
    assert found.walls == (0, 1)
    # As in the lab: up, to the right, and down again; y = 0.8 − (2.78 − 0.8 − 0.9).
    np.testing.assert_allclose(found.position, [0.9, -0.28, 0.0], atol=1e-12)


def test_between_facing_mirrors_a_ray_bounces_no_more_than_the_limit() -> None:
    # Two plates above and below the array's line of sight: the ray zigzags.
    walls = [wall((-5.0, 0.1), (5.0, 0.1)), wall((-5.0, -0.1), (5.0, -0.1))]
    found = launched(60.0, 4.0, walls)
    assert len(found.walls) == LONGEST_CHAIN
    assert set(found.walls) == {0, 1}
    assert np.linalg.norm(np.diff(found.path, axis=0), axis=-1).sum() == pytest.approx(4.0)


def sampled_covariance(
    aoa: float, length: float, walls: list[Wall], covariance: Float[np.ndarray, "2 2"], trials: int
) -> Float[np.ndarray, "2 2"]:
    """Scatter of the end as path and walls are drawn; every wall of the list is met, in order."""
    rng = np.random.default_rng(12)
    angles, lengths = rng.multivariate_normal([aoa, length], covariance, trials).T
    ends = lengths * np.exp(1j * angles)  # the plane as complex numbers
    for one in walls:
        tilts, offsets = rng.multivariate_normal([0, 0], one.covariance, trials).T
        middle = complex(*(0.5 * (one.start + one.end))[:2])
        along = complex(*(one.end - one.start)[:2]) / np.linalg.norm(one.end - one.start)
        turned = along * np.exp(1j * tilts)
        foot = middle - 1j * turned * offsets
        ends = foot + turned**2 * np.conj(ends - foot)  # mirrored about the line
    return np.asarray(np.cov(ends.real, ends.imag))


@pytest.mark.parametrize(
    ("aoa_deg", "length", "walls"),
    [
        pytest.param(75.0, 1.3, [], id="direct"),
        pytest.param(88.0, 1.8, [SLANTED], id="one wall"),
        pytest.param(
            90.0,
            2.78,
            [wall((-0.14, 0.66), (0.14, 0.94)), wall((0.79, 0.91), (1.01, 0.69))],
            id="two walls",
        ),
    ],
)
def test_the_covariance_of_the_position_is_that_of_monte_carlo(
    aoa_deg: float, length: float, walls: list[Wall]
) -> None:
    of_path = np.array([[4e-8, 1e-9], [1e-9, 1e-8]])  # 0.2 mrad, 0.1 mm
    of_wall = np.array([[9e-8, -1e-9], [-1e-9, 4e-9]])  # 0.3 mrad, 0.06 mm
    uncertain = [replace(one, covariance=of_wall) for one in walls]
    predicted = project(
        LINEAR, np.radians([aoa_deg]), length, uncertain, covariance=of_path
    ).covariance
    trials = 4000
    scatter = sampled_covariance(np.radians(aoa_deg), length, uncertain, of_path, trials)
    white = np.linalg.inv(np.linalg.cholesky(predicted[:2, :2]))
    spread = np.linalg.eigvalsh(white @ scatter @ white.T)
    # A variance of n trials scatters by √(2/n), 2 %: four of them; the second order is 1e-3.
    assert np.all(np.abs(spread - 1) <= 4 * np.sqrt(2 / trials)), spread
    np.testing.assert_allclose(predicted[2], 0)
    np.testing.assert_allclose(predicted, predicted.T)


def test_a_mirrors_tilt_turns_the_reflected_ray_twice_as_far() -> None:
    tilt = 1e-3
    over = launched(90.0, 1.8, [SLANTED.moved(np.array([tilt, 0.0]))])
    # From the hit, 1 m on: 2 mm sideways, to the left as the turn is counter-clockwise.
    np.testing.assert_allclose(over.position, [1.0, 0.8 + 2 * tilt, 0], atol=5 * tilt**2)


def test_moving_a_mirror_along_its_normal_moves_the_user_twice_as_far() -> None:
    offset = 1e-3
    over = launched(90.0, 1.8, [SLANTED.moved(np.array([0.0, offset]))])
    # The normal of a wall is its way turned by -90°: (1, -1)/√2.
    expected = np.array([1.0, 0.8, 0]) + 2 * offset * np.array([1, -1, 0]) / np.sqrt(2)
    np.testing.assert_allclose(over.position, expected, atol=1e-12)


def test_a_crossing_is_ahead_and_within_the_segment() -> None:
    def met(
        direction: tuple[float, float], start: tuple[float, float], end: tuple[float, float]
    ) -> tuple[float, float] | None:
        return crossing(
            np.zeros(3), np.array([*direction, 0.0]), np.array([*start, 0.0]), np.array([*end, 0.0])
        )

    assert met((0, 1), (-1, 2), (3, 2)) == pytest.approx((2.0, 1.0))
    assert met((0, -1), (-1, 2), (3, 2)) is None  # behind
    assert met((0, 1), (1, 2), (3, 2)) is None  # beside
    assert met((0, 1), (0, 2), (0, 3)) is None  # parallel, and in line
    assert met((0, 1), (0, 2), (1, 2)) == pytest.approx((2.0, 0.0))  # its very end
