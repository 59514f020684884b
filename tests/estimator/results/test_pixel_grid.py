import numpy as np
import pytest

from estimator.results.pixel_grid import PixelGrid


def test_a_plane_has_one_pixel_for_each_x_and_y() -> None:
    grid = PixelGrid.plane(x=np.array([0.0, 1.0]), y=np.array([2.0, 3.0, 4.0]), z=0.5)
    assert grid.shape == (2, 3)
    np.testing.assert_array_equal(grid.points[1, 2], [1.0, 4.0, 0.5])


def test_a_volume_has_one_pixel_for_each_x_y_and_z() -> None:
    grid = PixelGrid.volume(x=np.arange(2.0), y=np.arange(3.0), z=np.arange(4.0))
    assert grid.shape == (2, 3, 4)
    np.testing.assert_array_equal(grid.points[1, 2, 3], [1.0, 2.0, 3.0])


def test_a_box_is_filled_up_to_its_bounds() -> None:
    grid = PixelGrid.spanning(x=(-0.3, 0.3), y=(0.4, 1.0), spacing=1e-3)
    assert grid.shape == (601, 601)
    np.testing.assert_allclose(grid.spacing, (1e-3, 1e-3, 0.0))
    np.testing.assert_allclose(grid.extent, (-0.3005, 0.3005, 0.3995, 1.0005))


def test_a_spacing_that_does_not_divide_the_box_is_made_smaller() -> None:
    grid = PixelGrid.spanning(x=(0.0, 1.0), y=(0.0, 0.0), z=(0.0, 0.5), spacing=(0.3, 1.0, 0.5))
    assert grid.shape == (5, 1, 2)
    assert grid.spacing[0] == 0.25


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        (np.array([0.0, 1.0, 3.0]), "steps range from 1 to 2"),
        (np.array([1.0, 0.0]), "steps range from -1 to -1"),
        (np.array([0.0, np.nan]), "finite coordinates"),
        (np.zeros(0), "at least one pixel"),
    ],
)
def test_an_axis_that_makes_no_picture_is_refused(axis: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PixelGrid.plane(x=axis, y=np.array([0.0]))


def test_bounds_that_make_no_grid_are_refused() -> None:
    with pytest.raises(ValueError, match="y: bounds 1 … 0 m"):
        PixelGrid.spanning(x=(0.0, 1.0), y=(1.0, 0.0), spacing=0.1)
    with pytest.raises(ValueError, match="spacing of 0 m"):
        PixelGrid.spanning(x=(0.0, 1.0), y=(0.0, 1.0), spacing=0.0)
