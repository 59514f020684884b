from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from estimator.measurement.model import Measurement
from estimator.results.deferred import Deferred
from estimator.results.estimate import DirectionMap, Estimate, Image, Images, no_close_ups
from estimator.results.pixel_grid import PixelGrid
from mmslam.results.document import result_document
from mmslam.results.pictures_2d import write_pictures
from validation.figures import figures_3d
from validation.metrics.truth import Truth

BRIGHT = np.array([0.1, 0.8, -0.2])


@pytest.fixture
def volume() -> Image:
    grid = PixelGrid.spanning(x=(-0.3, 0.3), y=(0.5, 1.1), z=(-0.4, 0.2), spacing=0.02)
    spread = np.linalg.norm(grid.points - BRIGHT, axis=-1)
    return Image(values=np.exp(-((spread / 0.03) ** 2)).astype(np.complex128), grid=grid)


@pytest.fixture
def in_space(estimate: Estimate, volume: Image) -> Estimate:
    corners = np.array([[-0.1, 0.9, -0.2], [0.1, 1.0, -0.2], [0.1, 1.0, 0.2], [-0.1, 0.9, 0.2]])
    mirror = replace(estimate.mirrors[0], corners=corners, covariance=np.diag([1e-8, 1e-8, 1e-10]))
    heard = DirectionMap(
        values=np.ones((5, 6, 7), dtype=np.complex128),
        along=np.linspace(-0.2, 0.2, 5),
        up=np.linspace(-0.1, 0.1, 6),
        path_length=np.linspace(1.7, 1.9, 7),
        user="ann",
    )
    return replace(
        estimate,
        mirrors=(mirror,),
        users=(replace(estimate.users[0], elevation=0.05),),
        images=Deferred.of(Images(raw=volume, corrected=volume)),
        maps=(),
        close_up_maps=Deferred(no_close_ups),
        direction_maps=(heard,),
    )


@pytest.mark.parametrize("view", figures_3d.VIEWS)
def test_a_bright_voxel_is_drawn_where_it_is(volume: Image, view: figures_3d.Projection) -> None:
    ax = Figure().subplots()
    box = figures_3d.box_around(volume.grid.points.reshape(-1, 3))
    figures_3d.draw_projection(ax, volume, view, box)
    (picture,) = ax.images
    level = np.asarray(picture.get_array())
    row, column = np.unravel_index(int(np.argmax(level)), level.shape)
    left, right, bottom, top = picture.get_extent()
    place = (
        left + (column + 0.5) / level.shape[1] * (right - left),
        bottom + (row + 0.5) / level.shape[0] * (top - bottom),
    )
    np.testing.assert_allclose(place, BRIGHT[[view.right, view.up]], atol=0.01)  # half a voxel
    assert level.max() == 0.0


def test_a_result_in_space_has_all_its_pictures(
    tmp_path: Path, measurement: Measurement, in_space: Estimate, truth: Truth
) -> None:
    paths = write_pictures(tmp_path, measurement, in_space, truth)
    assert sorted(paths) == [
        "angle_range_map.png",
        "corrected_image.png",
        "localization.png",
        "raw_image.png",
    ]
    assert all(path.stat().st_size > 10_000 for path in paths.values())


def test_a_result_in_space_tells_corners_and_elevation(
    measurement: Measurement, in_space: Estimate, truth: Truth
) -> None:
    document = result_document(measurement, in_space, truth)
    assert np.shape(document["mirrors"][0]["corners_m"]) == (4, 3)
    assert np.shape(document["mirrors"][0]["covariance"]) == (3, 3)
    assert document["users"][0]["elevation_deg"] == pytest.approx(np.degrees(0.05))
