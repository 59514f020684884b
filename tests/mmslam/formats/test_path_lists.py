"""Path lists: tables and matrices into lists, into the measurement file, and located."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light
from scipy.io import savemat

from estimator.array.array_frame import ArrayFrame
from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_2d import Wall
from estimator.localization.listed_users import paths_of_list
from estimator.measurement.model import MeasurementError, PathList
from estimator.positioning.decision_rules import decide
from estimator.positioning.map_context import MapContext, block_covariance
from mmslam.formats.import_measured import Import
from mmslam.location import locate_measurement
from mmslam.measured_data import import_to_file
from mmslam.measurement_files import read
from validation.trials.path_lists import drawn_paths

Take = Callable[[Path, str, str], Import]

MAPPING = """
clock_offset_ns = 0.0
[paths]
place = "spot"
azimuth = "az"
elevation = "el"
delay = "tau"
power_db = "p"
frequency_ghz = 60.0
angle_deviation_deg = 2.0
delay_deviation_ns = 0.3
"""
ROWS = "spot,az,el,tau,p\n4,30,-5,10.5,-80\n7,120,0,12.25,-85\n4,-60,12,20,-95.5\n"


def test_rows_of_one_place_make_one_list(tmp_path: Path, take: Take) -> None:
    (tmp_path / "list.csv").write_text(ROWS)
    lists = take(tmp_path, "list.csv", MAPPING).measurement.path_lists
    assert [one.user for one in lists] == ["place 4", "place 7"]
    np.testing.assert_allclose(np.degrees(lists[0].azimuth), [30, -60])
    assert lists[0].elevation is not None
    np.testing.assert_allclose(np.degrees(lists[0].elevation), [-5, 12])
    np.testing.assert_allclose(lists[0].delay, [10.5e-9, 20e-9])
    np.testing.assert_array_equal(lists[1].gain_db, [-85])
    assert lists[0].frequency == 60e9


def test_matrices_are_places_times_paths_with_gaps(tmp_path: Path, take: Take) -> None:
    gap = np.nan
    az = np.array([[10.0, 20.0, gap], [30.0, gap, gap]])
    savemat(tmp_path / "list.mat", {"az": np.radians(az), "tau": 1e-9 * (az + 5), "p": az - 90})
    mapping = """
    [paths]
    azimuth = "az"
    angle_unit = "rad"
    azimuth_zero = "y"
    clockwise = true
    delay = "tau"
    delay_unit = "s"
    power_db = "p"
    power_offset_db = -20.0
    angle_deviation_deg = 1.0
    delay_deviation_ns = 0.1
    """
    lists = take(tmp_path, "list.mat", mapping).measurement.path_lists
    assert [one.azimuth.size for one in lists] == [2, 1]
    np.testing.assert_allclose(np.degrees(lists[0].azimuth), [80, 70])  # from +x, the other way
    np.testing.assert_allclose(lists[1].delay, [35e-9])
    assert lists[1].gain_db is not None
    np.testing.assert_allclose(lists[1].gain_db, [-80])
    assert lists[0].elevation is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('azimuth = "az"', 'azimuth = "phi"', "no column 'phi'"),
        ('elevation = "el"', 'elevation = "el"\nzenith = true', "elevation of 95° is beyond 90°"),
        ("angle_deviation_deg = 2.0", "", "angle_deviation_deg"),
        ("delay_deviation_ns = 0.3", "delay_deviation_ns = 0", "delay_deviation_ns"),
    ],
)
def test_what_is_wrong_with_a_list_is_named(
    tmp_path: Path, take: Take, old: str, new: str, message: str
) -> None:
    (tmp_path / "list.csv").write_text(ROWS)
    with pytest.raises(MeasurementError, match=message):
        take(tmp_path, "list.csv", MAPPING.replace(old, new))


def test_columns_of_other_sizes_are_refused(tmp_path: Path, take: Take) -> None:
    np.savez(tmp_path / "list.npz", spot=[1, 1], az=[1.0, 2.0], el=[1.0, 2.0], tau=[1.0], p=[1, 2])
    with pytest.raises(MeasurementError, match=r"'tau' has shape \(1,\), but 'az' has \(2,\)"):
        take(tmp_path, "list.npz", MAPPING)


def test_a_list_goes_through_the_file_and_is_located_with_pictures(tmp_path: Path) -> None:
    drawn = drawn_paths(np.random.default_rng(7001), "open", space=True)
    rows = ["spot,az,el,tau,p"]
    walk = drawn.lists[:8]
    for number, one in enumerate(walk):
        assert one.elevation is not None
        assert one.gain_db is not None
        columns = (one.azimuth, one.elevation, 1e9 * one.delay, one.gain_db)
        for az, el, tau, level in zip(*columns, strict=True):
            rows.append(f"{number},{np.degrees(az):.6f},{np.degrees(el):.6f},{tau:.6f},{level}")
    (tmp_path / "walk.csv").write_text("\n".join(rows))
    (tmp_path / "walk.toml").write_text(MAPPING)
    store = tmp_path / "walk.zarr"
    import_to_file(tmp_path / "walk.csv", mapping=tmp_path / "walk.toml", uplink=None, path=store)
    again = read(store).path_lists
    np.testing.assert_allclose(again[0].delay, drawn.lists[0].delay, atol=1e-15)
    assert len(again) == len(walk)
    assert "paths of" in repr(read(store))
    outcome = locate_measurement(store, sample=None, folder=tmp_path / "out")
    result = json.loads((outcome.folder / "result.json").read_text())
    assert result["dimensions"] == 3
    found = [user for user in result["users"] if user["status"] == "found"]
    assert len(found) > 0.8 * len(walk)
    assert result["mirrors"][0]["level_db"] is None
    assert (outcome.folder / "localization.png").stat().st_size > 10_000


def test_beside_an_echo_a_list_is_folded_over_the_walls_that_it_shows() -> None:
    wall = Wall(
        start=np.array([-0.5, 2.0, 0.0]),
        end=np.array([1.5, 2.0, 0.0]),
        covariance=np.diag([1e-6, 1e-6]),
    )
    context = MapContext(
        walls=(wall,),
        wall_covariance=block_covariance([wall]),
        resolution=Resolution(along_ray=2e-3, across_ray=5e-3),
        imaged=True,
        unassigned_peaks=np.zeros((0, 3)),
        reach=np.inf,
        widest=1.0,
        contrast=np.inf,
    )
    user = np.array([0.9, 0.8, 0.0])
    image = np.array([0.9, 3.2, 0.0])
    points = np.stack([user, image, [0.3, -2.0, 0.0]])  # the last one from behind the array
    length = np.linalg.norm(points, axis=1)
    one = PathList(
        user="a",
        azimuth=np.arctan2(points[:, 1], points[:, 0]),
        delay=length / speed_of_light - 3e-9,
        angle_deviation=0.01,
        delay_deviation=0.02e-9,
    )
    frame = ArrayFrame(origin=np.zeros(3), axes=np.eye(3))
    paths, left = paths_of_list(one, frame, linear=True, clock_offset=3e-9)
    assert left == 1
    found = decide(one.user, paths, context)
    assert found.status == "found"
    assert found.position is not None
    np.testing.assert_allclose(found.position, user, atol=0.02)  # two deviations of the angle
