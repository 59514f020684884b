"""Flat things that face a planar array: their image is brightest beyond them, their fit is not."""

import numpy as np
import pytest
from jaxtyping import Float

from estimator.localization.pipeline import locate
from estimator.mapping.facing_depth import facing_surface
from estimator.measurement.model import Echo, Measurement
from simulator.receiver.impairments import complex_noise
from validation.trials.measured_scans import facing_echo, letter_points


def scan(count: int, spacing: float) -> Float[np.ndarray, "positions 3"]:
    places = (np.arange(count) - (count - 1) / 2) * spacing
    x, z = np.meshgrid(places, places, indexing="ij")
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)


def echo_of(
    points: Float[np.ndarray, "points 3"],
    positions: Float[np.ndarray, "positions 3"],
    band: Float[np.ndarray, " freqs"],
) -> Echo:
    samples = facing_echo(points, np.ones(len(points), dtype=complex), positions, band)
    samples /= np.sqrt(np.mean(np.abs(samples) ** 2))
    noise = complex_noise(samples.shape, 0.01, np.random.default_rng(4))  # 20 dB below
    return Echo(samples=samples + noise, positions=positions, frequencies=band)


@pytest.mark.parametrize("mean_taken", [False, True])
def test_a_plate_of_a_wavelength_is_at_its_depth(mean_taken: bool) -> None:
    """A plate of 12 cm at 2.4–3 GHz before 1 m: the image peaks centimetres beyond it."""
    side = np.linspace(-0.06, 0.06, 7)
    x, z = np.meshgrid(side, side)
    plate = np.stack([x.ravel(), np.full(x.size, 0.7), z.ravel()], axis=-1)
    echo = echo_of(plate, scan(11, 0.1), np.linspace(2.4e9, 3e9, 101))
    if mean_taken:
        rest = echo.samples - echo.samples.mean(axis=0)
        echo = Echo(samples=rest, positions=echo.positions, frequencies=echo.frequencies)
    (target, *_) = locate(Measurement(echo=echo, uplinks=())).targets
    assert abs(target.position[1] - 0.7) < 5e-3  # a sixteenth of the step of 10 depths over 0.9 m


def test_a_letter_in_the_first_range_cell_is_at_its_depth() -> None:
    """Delays tell 0.3 m apart; the image of a flat letter peaks where it likes within that."""
    letter = letter_points(0.06, 2.5e-3) + np.array([0.0, 0.15, 0.0])
    echo = echo_of(letter, scan(41, 4e-3), np.linspace(24e9, 24.5e9, 6))
    estimate = locate(Measurement(echo=echo, uplinks=()))
    assert not estimate.mirrors
    (target,) = estimate.targets
    assert abs(target.position[1] - 0.15) < 5e-3


def test_a_line_of_positions_and_noise_have_no_surface() -> None:
    line = scan(11, 0.1)[5::11]
    echo = echo_of(np.array([[0.0, 0.7, 0.0]]), line, np.linspace(2.4e9, 3e9, 101))
    ends = np.array([0.05, 0.0, 0.05])
    peak = np.array([0.0, 0.8, 0.0])
    assert facing_surface(echo, peak, -ends, ends) is None
    noise = complex_noise((121, 101), 1.0, np.random.default_rng(3))
    plane = Echo(samples=noise, positions=scan(11, 0.1), frequencies=echo.frequencies)
    assert facing_surface(plane, peak, -ends, ends) is None
