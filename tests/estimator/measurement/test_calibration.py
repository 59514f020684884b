from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.imaging.backprojection import backproject
from estimator.measurement.calibration import (
    equalise,
    measured_response,
    remove_path,
    subtract_background,
    without_frequencies,
)
from estimator.measurement.model import Echo, MeasurementError

FREQUENCIES = np.linspace(220e9, 295e9, 201)
POSITIONS = np.stack([np.linspace(-0.03, 0.03, 40), np.zeros(40), np.zeros(40)], axis=1)
TARGET = np.array([0.01, 0.3, 0.0])


def echo_of(target: np.ndarray, extra_path: float = 0.0) -> Echo:
    path = 2 * np.linalg.norm(target - POSITIONS, axis=1) + extra_path
    samples = np.exp(-2j * np.pi * path[:, None] / speed_of_light * FREQUENCIES)
    return Echo(samples=samples, positions=POSITIONS, frequencies=FREQUENCIES)


def test_a_background_is_gone_after_subtraction() -> None:
    target, clutter = echo_of(TARGET), echo_of(np.array([-0.1, 0.2, 0.0]))
    both = replace(target, samples=target.samples + clutter.samples)
    found = subtract_background(both, clutter)
    np.testing.assert_allclose(found.samples, target.samples, atol=1e-15)


def test_a_cable_shifts_no_target_once_its_length_is_removed() -> None:
    cable, velocity_factor = 0.14, 0.7
    echo = echo_of(TARGET, extra_path=cable / velocity_factor)
    corrected = remove_path(echo, cable, velocity_factor=velocity_factor)
    assert abs(backproject(echo, TARGET[None])[0]) < 0.1
    assert abs(backproject(corrected, TARGET[None])[0] - 1) < 1e-3  # back-projection's promise


def test_a_known_target_calibrates_the_response_over_frequency() -> None:
    rng = np.random.default_rng(5)
    response = np.exp(0.3 * rng.normal(size=201) + 2j * np.pi * rng.uniform(size=201))
    ideal = echo_of(np.array([0.0, 0.25, 0.0]))
    measured = replace(ideal, samples=ideal.samples * response)
    found = measured_response(measured, ideal.samples)
    np.testing.assert_allclose(found, response, rtol=1e-12)
    other = echo_of(TARGET)
    received = replace(other, samples=other.samples * response)
    np.testing.assert_allclose(equalise(received, found).samples, other.samples, atol=1e-12)
    phases = equalise(received, found, phase_only=True)
    np.testing.assert_allclose(np.angle(phases.samples / other.samples), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(phases.samples), np.abs(received.samples))


def test_a_sweep_with_a_band_cut_out_still_focuses() -> None:
    bands = np.array([[220e9, 240e9], [255e9, 295e9]])
    sparse = without_frequencies(echo_of(TARGET), bands)
    assert 120 < sparse.frequencies.size < 201
    assert abs(backproject(sparse, TARGET[None])[0] - 1) < 1e-3


def test_calibration_that_does_not_fit_is_refused() -> None:
    echo = echo_of(TARGET)
    fewer = replace(echo, samples=echo.samples[:10], positions=POSITIONS[:10])
    shifted = replace(echo, frequencies=FREQUENCIES + 10.0)
    with pytest.raises(MeasurementError, match="its positions differ"):
        subtract_background(echo, fewer)
    with pytest.raises(MeasurementError, match="its frequencies differ"):
        subtract_background(echo, shifted)
    with pytest.raises(MeasurementError, match="all samples are zero"):
        subtract_background(echo, echo)
    with pytest.raises(MeasurementError, match="length is nan"):
        remove_path(echo, float("nan"))
    with pytest.raises(MeasurementError, match=r"velocity factor 1\.2"):
        remove_path(echo, 1.0, velocity_factor=1.2)
    with pytest.raises(MeasurementError, match="they must be equal"):
        measured_response(echo, echo.samples[:5].copy())
    silent = echo.samples.copy()
    silent[:, 3] = 0
    with pytest.raises(MeasurementError, match=r"nothing is expected at 2\.21125e\+11 Hz"):
        measured_response(echo, silent)
    with pytest.raises(MeasurementError, match="response at 5 frequencies"):
        equalise(echo, np.ones(5, dtype=complex))
    weak = np.ones(201, dtype=complex)
    weak[7] = 1e-4
    with pytest.raises(MeasurementError, match=r"2\.22625e\+11 Hz is more than 60 dB below"):
        equalise(echo, weak)
    with pytest.raises(MeasurementError, match="no frequency of"):
        without_frequencies(echo, np.array([[1e9, 2e9]]))
