"""Measurements of plain arrays."""

import pickle

import numpy as np
import pytest

import mmslam
from estimator.measurement.model import MeasurementError

FREQUENCIES = np.linspace(220e9, 221e9, 5)
POSITIONS = 5e-4 * np.arange(4)
RNG = np.random.default_rng(0)
SAMPLES = RNG.normal(size=(4, 5)) + 1j * RNG.normal(size=(4, 5))


def test_one_column_of_positions_lies_along_x() -> None:
    made = mmslam.Measurement.from_arrays(
        frequencies=FREQUENCIES, positions=POSITIONS, echo=SAMPLES
    )
    assert made.echo is not None
    np.testing.assert_array_equal(made.echo.positions[:, 0], POSITIONS)
    np.testing.assert_array_equal(made.echo.positions[:, 1:], 0.0)


def test_lists_and_single_precision_become_double_precision() -> None:
    made = mmslam.Measurement.from_arrays(
        frequencies=FREQUENCIES.tolist(),
        positions=[[x, 0.0, 0.0] for x in POSITIONS],
        uplink=SAMPLES.astype(np.complex64),
    )
    (pilot,) = made.uplinks
    assert pilot.user == "user"
    assert pilot.samples.dtype == np.complex128
    np.testing.assert_array_equal(pilot.samples, SAMPLES.astype(np.complex64))


def test_users_have_the_names_that_are_given_and_places_of_their_own() -> None:
    elsewhere = POSITIONS + 0.1
    made = mmslam.Measurement.from_arrays(
        frequencies=FREQUENCIES,
        positions=POSITIONS,
        echo=SAMPLES,
        uplink={"ann": SAMPLES, "bob": 2 * SAMPLES},
        element_positions=elsewhere,
        transmit_positions=POSITIONS + 0.01,
        clock_offset=0.0,
    )
    assert [one.user for one in made.uplinks] == ["ann", "bob"]
    np.testing.assert_array_equal(made.uplinks[1].positions[:, 0], elsewhere)
    assert made.echo is not None
    assert made.echo.transmit_positions is not None
    assert "uplinks of ann, bob" in repr(made)
    assert "clock        shared" in repr(made)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(MeasurementError, match=r"positions have shape \(4, 2\); give"):
        mmslam.Measurement.from_arrays(
            frequencies=FREQUENCIES, positions=np.zeros((4, 2)), echo=SAMPLES
        )
    with pytest.raises(MeasurementError, match="neither 'echo' nor 'uplink'"):
        mmslam.Measurement.from_arrays(frequencies=FREQUENCIES, positions=POSITIONS)


def test_of_plain_arrays_no_truth_is_known() -> None:
    made = mmslam.Measurement.from_arrays(
        frequencies=FREQUENCIES, positions=POSITIONS, echo=SAMPLES
    )
    assert made.truth.user_position == {}
    assert made.truth_dataset is None
    assert "truth        unknown" in repr(made)


def test_a_measurement_can_be_sent_to_another_process() -> None:
    made = mmslam.Measurement.from_arrays(
        frequencies=FREQUENCIES, positions=POSITIONS, echo=SAMPLES
    )
    sent = pickle.loads(pickle.dumps(made))
    assert sent.to_xarray().equals(made.to_xarray())
