from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from estimator.measurement.model import Measurement, MeasurementError, Uplink
from estimator.measurement.store import write_measurement
from validation.metrics.truth import Truth, front_face, read_truth, truth_from_dataset

AXIS = np.array(["x", "y", "z"], dtype=np.dtypes.StringDType())


@pytest.fixture
def measurement() -> Measurement:
    uplink = Uplink(
        samples=np.ones((1, 2), dtype=np.complex128),
        positions=np.zeros((1, 3)),
        frequencies=np.array([1e9, 2e9]),
        user="ann",
    )
    return Measurement(echo=None, uplinks=(uplink,))


def truth_dataset() -> xr.Dataset:
    return xr.Dataset(
        {
            "user_position": (("user", "axis"), np.array([[1.0, 0.8, 0.0], [np.nan] * 3])),
            "wall_start": (("wall", "axis"), np.array([[-0.2, 0.8, 0.0]])),
            "wall_end": (("wall", "axis"), np.array([[0.2, 0.8, 0.0]])),
            "target_position": (("target", "axis"), np.array([[0.3, 0.5, 0.0], [np.nan] * 3])),
            "target_size": (("target", "axis"), np.array([[0.01, 0.01, 0.0], [np.nan] * 3])),
            "target_angle": ("target", np.array([0.0, np.nan])),
            "target_kind": ("target", np.array(["cylinder", ""], dtype=np.dtypes.StringDType())),
        },
        {
            "user": np.array(["ann", "bob"], dtype=np.dtypes.StringDType()),
            "wall": np.array(["door"], dtype=np.dtypes.StringDType()),
            "target": np.array(["post", "none"], dtype=np.dtypes.StringDType()),
            "axis": AXIS,
        },
    )


def test_the_truth_comes_back_by_name_as_it_was_written(
    tmp_path: Path, measurement: Measurement
) -> None:
    write_measurement(tmp_path / "m.zarr", measurement, truth=truth_dataset())
    truth = read_truth(tmp_path / "m.zarr")
    assert list(truth.user_position) == ["ann"]  # NaN pads what is not there
    np.testing.assert_array_equal(truth.user_position["ann"], [1.0, 0.8, 0.0])
    np.testing.assert_array_equal(truth.wall_end["door"], [0.2, 0.8, 0.0])
    np.testing.assert_array_equal(truth.target_position["post"], [0.3, 0.5, 0.0])
    assert set(truth.target_position) == set(truth.target_size) == {"post"}
    assert (truth.target_angle, truth.target_kind) == ({"post": 0.0}, {"post": "cylinder"})


def test_a_measurement_without_truth_has_an_empty_one(
    tmp_path: Path, measurement: Measurement
) -> None:
    write_measurement(tmp_path / "m.zarr", measurement)
    assert read_truth(tmp_path / "m.zarr").user_position == {}


def test_a_damaged_truth_is_named(tmp_path: Path, measurement: Measurement) -> None:
    write_measurement(tmp_path / "m.zarr", measurement, truth=truth_dataset())
    (tmp_path / "m.zarr" / "truth" / "zarr.json").write_text("{")
    with pytest.raises(MeasurementError, match="truth cannot be read"):
        read_truth(tmp_path / "m.zarr")


def test_a_truth_of_other_dimensions_is_refused() -> None:
    with pytest.raises(MeasurementError, match="user_position"):
        truth_from_dataset(xr.Dataset({"user_position": ("axis", np.zeros(3))}))


def test_targets_of_other_dimensions_are_refused() -> None:
    with pytest.raises(MeasurementError, match="target_angle"):
        truth_from_dataset(xr.Dataset({"target_angle": (("target", "axis"), np.zeros((1, 3)))}))


def body(kind: str, size: list[float], angle: float = 0.0) -> Truth:
    return Truth(
        target_position={"it": np.array([1.0, 2.0, 0.0])},
        target_size={"it": np.array(size)},
        target_angle={"it": angle},
        target_kind={"it": kind},
    )


def test_a_post_shows_its_radius_toward_the_viewer() -> None:
    post = body("cylinder", [0.02, 0.02, 0.0], angle=0.7)  # round: its angle does not matter
    np.testing.assert_allclose(
        front_face(post, "it", np.array([4.0, -2.0, 0.0])), [1.006, 1.992, 0.0], atol=1e-12
    )


def test_a_post_of_some_height_is_seen_at_the_viewers_height() -> None:
    post = body("cylinder", [0.02, 0.02, 0.5])
    seen = front_face(post, "it", np.array([1.0, 0.0, 0.1]))
    np.testing.assert_allclose(seen, [1.0, 1.99, 0.1], atol=1e-12)
    above = front_face(post, "it", np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(above, [1.0, 2.0, 0.25], atol=1e-12)


def test_a_turned_box_shows_the_face_or_the_corner_that_is_nearest() -> None:
    box = body("box", [0.2, 0.1, 0.0], angle=np.pi / 2)  # its length along y
    face = front_face(box, "it", np.array([0.0, 2.03, 0.0]))
    np.testing.assert_allclose(face, [0.95, 2.03, 0.0], atol=1e-12)
    corner = front_face(box, "it", np.array([0.0, 0.0, 0.0]))
    np.testing.assert_allclose(corner, [0.95, 1.9, 0.0], atol=1e-12)


def test_a_target_of_unknown_size_is_a_point() -> None:
    truth = Truth(target_position={"it": np.array([1.0, 2.0, 0.0])})
    np.testing.assert_array_equal(front_face(truth, "it", np.zeros(3)), [1.0, 2.0, 0.0])
