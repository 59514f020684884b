from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from estimator.measurement import Measurement, MeasurementError, Uplink
from estimator.storage import write_measurement
from validation.truth import read_truth, truth_from_dataset

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
        },
        {
            "user": np.array(["ann", "bob"], dtype=np.dtypes.StringDType()),
            "wall": np.array(["door"], dtype=np.dtypes.StringDType()),
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
