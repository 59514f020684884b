import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from simulator.geometry.mirrors import Mirrors, line_mirrors
from simulator.materials.fresnel_slab import Conductor

coordinates = st.floats(-2.0, 2.0, allow_subnormal=False)
points = arrays(np.float64, (5, 3), elements=coordinates)


def one_mirror(corners: list[list[float]]) -> Mirrors:
    return Mirrors(
        corners=np.array([corners], dtype=float),
        materials=(Conductor(),),
        rms_heights=np.zeros(1),
        two_sided=np.ones(1, dtype=bool),
    )


OBLIQUE = one_mirror([[0, 0, 0], [1, 2, 0], [0.5, 1, 2], [-0.5, -1, 2]])


@given(points=points)
def test_the_image_of_an_image_is_the_point_itself(points: np.ndarray) -> None:
    image = OBLIQUE.images(points, 0)
    np.testing.assert_allclose(OBLIQUE.images(image, 0), points, atol=1e-14)  # of some metres
    np.testing.assert_allclose(OBLIQUE.heights(image, 0), -OBLIQUE.heights(points, 0), atol=1e-14)


@given(points=points)
def test_directions_turn_as_differences_of_images(points: np.ndarray) -> None:
    images = OBLIQUE.images(points, 0)
    turned = OBLIQUE.turned(points[1:] - points[:-1], 0)
    np.testing.assert_allclose(turned, images[1:] - images[:-1], atol=1e-14)


def test_the_normal_follows_the_corners_by_the_right_hand() -> None:
    square = one_mirror([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(square.normals, [[0, 0, 1]])
    line = line_mirrors(
        np.zeros((1, 3)),
        np.array([[2.0, 0.0, 0.0]]),
        materials=[Conductor()],
        rms_heights=np.zeros(1),
        two_sided=np.ones(1, dtype=bool),
    )
    np.testing.assert_allclose(line.normals, [[0, -1, 0]], atol=1e-15)


def test_the_margin_is_the_distance_from_the_nearest_edge() -> None:
    square = one_mirror([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])
    inside = np.array([[1, 0.5, 0], [1.9, 0.5, 0], [0.3, 0.1, 0], [2.2, 0.5, 0], [1, -0.3, 0]])
    np.testing.assert_allclose(square.margins(inside, 0), [0.5, 0.1, 0.1, -0.2, -0.3], atol=1e-15)


def test_a_triangle_is_a_mirror_with_a_corner_repeated() -> None:
    triangle = one_mirror([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(triangle.normals, [[0, 0, 1]])
    margins = triangle.margins(np.array([[0.25, 0.25, 0], [0.6, 0.6, 0]]), 0)
    np.testing.assert_allclose(margins, [0.25, -0.2 / np.sqrt(2)], atol=1e-15)


def test_a_warped_quadrilateral_is_no_mirror() -> None:
    with pytest.raises(ValueError, match=r"mirror 0 is not flat: .* the limit is 1e-06 m"):
        one_mirror([[0, 0, 0], [1, 0, 0], [1, 1, 0.01], [0, 1, 0]])


@pytest.mark.parametrize(
    "corners",
    [
        [[0, 0, 0], [2, 0, 0], [0.3, 0.3, 0], [0, 2, 0]],  # an arrow
        [[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]],  # a bow tie, without a normal
    ],
)
def test_corners_out_of_order_are_no_mirror(corners: list[list[float]]) -> None:
    with pytest.raises(ValueError, match=r"mirror 0 (is not convex|has an area of 0)"):
        one_mirror(corners)


def test_a_mirror_without_area_is_refused() -> None:
    with pytest.raises(ValueError, match=r"mirror 0 has an area of 0 m², the limit is 1e-10 m²"):
        one_mirror([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0]])


def test_each_mirror_needs_its_material() -> None:
    with pytest.raises(ValueError, match="1 mirrors have 0 materials"):
        Mirrors(
            corners=OBLIQUE.corners,
            materials=(),
            rms_heights=np.zeros(1),
            two_sided=np.ones(1, dtype=bool),
        )
