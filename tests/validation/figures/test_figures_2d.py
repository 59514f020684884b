import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from estimator.results.estimate import AngleRangeMap, Estimate, Image, UserEstimate
from estimator.results.pixel_grid import PixelGrid
from validation.figures import figures_2d, views


@pytest.fixture
def ax() -> Axes:
    axes = Figure().subplots()
    assert isinstance(axes, Axes)
    return axes


def point_image(x: float, y: float) -> Image:
    """One bright pixel on a dim ground."""
    grid = PixelGrid.spanning(x=(-0.5, 0.5), y=(0.2, 1.4), spacing=0.01)
    values = np.full(grid.shape, 1e-3, dtype=np.complex128)
    values[np.argmin(np.abs(grid.x - x)), np.argmin(np.abs(grid.y - y))] = 1.0
    return Image(values=values, grid=grid)


def level_at(ax: Axes, x: float, y: float) -> float:
    picture = ax.images[0]
    left, right, bottom, top = picture.get_extent()
    pixels = np.asarray(picture.get_array())
    rows, columns = pixels.shape
    row = int((y - bottom) / (top - bottom) * rows)
    column = int((x - left) / (right - left) * columns)
    return float(pixels[row, column])


VIEW = views.View(left=-0.5, right=0.5, bottom=0.2, top=1.4)


def test_a_point_is_drawn_where_it_is_at_zero_decibels(ax: Axes) -> None:
    figures_2d.draw_image(ax, point_image(0.23, 1.1), view=VIEW)
    assert level_at(ax, 0.23, 1.1) == pytest.approx(0.0)
    assert level_at(ax, -0.23, 1.1) == pytest.approx(
        figures_2d.FLOOR_DB
    )  # -60 dB, cut at the floor
    assert ax.images[0].get_clim() == (figures_2d.FLOOR_DB, 0.0)


def test_an_image_of_nothing_is_dark_and_no_error(ax: Axes) -> None:
    image = point_image(0.0, 0.8)
    figures_2d.draw_image(ax, Image(values=0 * image.values, grid=image.grid), view=VIEW)
    assert level_at(ax, 0.0, 0.8) == figures_2d.FLOOR_DB


def test_a_metre_is_as_long_in_x_as_in_y(ax: Axes) -> None:
    figures_2d.draw_image(ax, point_image(0.0, 0.8), view=VIEW)
    assert ax.get_aspect() == 1.0
    assert "[m]" in ax.get_xlabel()
    assert "[m]" in ax.get_ylabel()


def test_a_thin_bright_line_survives_the_reduction_of_a_large_image(ax: Axes) -> None:
    grid = PixelGrid.spanning(x=(0.0, 1.0), y=(0.0, 0.1), spacing=1 / 5000)
    values = np.full(grid.shape, 1e-3, dtype=np.complex128)
    values[3333, :] = 1.0
    view = views.View(left=0.0, right=1.0, bottom=0.0, top=0.1)
    figures_2d.draw_image(ax, Image(values=values, grid=grid), view=view)
    assert max(np.asarray(ax.images[0].get_array()).shape) <= 1200
    assert level_at(ax, 3333 / 5000, 0.05) == pytest.approx(0.0)


def test_the_crop_holds_what_is_bright_and_not_the_empty_room() -> None:
    low, high = views.bright_points(point_image(0.23, 1.1))
    # The two corners are pixel centres: the bright one's, to within a pixel.
    np.testing.assert_allclose(low, [0.23, 1.1, 0.0], atol=0.01)
    np.testing.assert_allclose(high, [0.23, 1.1, 0.0], atol=0.01)


def test_a_view_holds_all_its_points_with_a_margin() -> None:
    view = views.view_around(np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [np.nan] * 3]))
    assert view.left < 0.0
    assert view.right > 1.0
    assert view.bottom < 0.0
    assert view.top > 0.2
    assert view.aspect < 2.0  # a row of points is no slit


def test_the_peak_of_a_map_is_marked_in_degrees_and_metres(ax: Axes) -> None:
    aoa = np.arccos(np.linspace(0.9, -0.9, 61))
    length = np.linspace(1.0, 2.0, 101)
    values = np.full((61, 101), 1e-3, dtype=np.complex128)
    values[np.argmin(np.abs(aoa - np.radians(70.0))), 80] = 1.0  # 70°, 1.8 m
    heard = AngleRangeMap(values=values, aoa=aoa, path_length=length, user="ann")
    user = UserEstimate(name="ann", status="found", aoa=np.radians(70.0), path_length=1.8)
    figures_2d.draw_angle_range_map(ax, heard, user)
    mesh = ax.collections[0]
    assert isinstance(mesh, QuadMesh)
    levels = np.asarray(mesh.get_array())
    row, column = (int(n) for n in np.unravel_index(np.argmax(levels), levels.shape))
    coordinates = np.asarray(mesh.get_coordinates(), dtype=np.float64)
    corners = coordinates[row : row + 2, column : column + 2].reshape(4, 2)
    assert levels[row, column] == pytest.approx(0.0)
    # The bright cell holds the peak, though angles are spaced evenly in their cosine.
    assert (corners.min(axis=0) < (70.0, 1.8)).all()
    assert (corners.max(axis=0) > (70.0, 1.8)).all()
    marks = [np.asarray(line.get_xydata(), dtype=np.float64)[0] for line in ax.lines]
    np.testing.assert_allclose(marks, [(70.0, 1.8)])
    assert [text.get_text() for text in ax.texts] == ["70.000°, 1.8000 m"]


def test_a_part_of_a_map_is_compared_with_the_peak_of_the_whole(ax: Axes) -> None:
    part = AngleRangeMap(
        values=np.full((5, 7), 0.1, dtype=np.complex128),
        aoa=np.radians(np.linspace(69.0, 71.0, 5)),
        path_length=np.linspace(1.79, 1.81, 7),
        user="ann",
    )
    user = UserEstimate(name="ann", status="found", aoa=np.radians(70.0), path_length=1.8)
    figures_2d.draw_angle_range_map(ax, part, user, peak=1.0)
    levels = np.asarray(ax.collections[0].get_array())
    np.testing.assert_allclose(levels, -20.0)  # 0.1 of the peak's magnitude


def test_a_close_up_counts_millimetres_from_the_truth(ax: Axes) -> None:
    user = UserEstimate(
        name="ann",
        status="found",
        position=np.array([1.0003, 0.8004, 0.0]),
        covariance=np.diag([4e-8, 1e-8, 0.0]),
    )
    figures_2d.draw_close_up(ax, user, np.array([1.0, 0.8, 0.0]))
    drawn = np.asarray(ax.lines[-2].get_xydata(), dtype=np.float64)
    np.testing.assert_allclose(drawn, [[0.3, 0.4]], atol=1e-9)
    assert ax.get_title() == "ann: 0.500 mm off"
    # 0.2 mm and 0.1 mm of deviation: full axes 0.4 mm by 0.2 mm, the longer along x.
    inner = ax.patches[-1]
    assert isinstance(inner, Ellipse)
    assert (inner.width, inner.height) == pytest.approx((0.4, 0.2))
    assert abs(np.sin(np.radians(inner.angle))) == pytest.approx(0.0, abs=1e-9)


def test_without_a_position_there_is_nothing_to_enlarge(ax: Axes) -> None:
    with pytest.raises(ValueError, match="no position"):
        figures_2d.draw_close_up(ax, UserEstimate(name="ann", status="not_found"))


def test_the_truth_is_drawn_only_where_it_is_known(ax: Axes) -> None:
    estimate = Estimate(users=(), mirrors=())
    positions = np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
    figures_2d.draw_localization(ax, estimate, positions, view=VIEW)
    without = len(ax.lines)
    truth = np.array([0.3, 0.7, 0.0])
    figures_2d.draw_localization(ax, estimate, positions, view=VIEW, true_positions=[truth])
    added = ax.lines[without:]
    assert any(np.array_equal(line.get_xydata(), [[0.3, 0.7]]) for line in added)
    assert len(added) == without + 1
