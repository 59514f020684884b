"""Curvature and delay of one wave: the delay that cables add, and the sign of the phase."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.measurement.delay_by_focus import FocusDelay, focus_delay
from estimator.measurement.model import Echo, Uplink

BORESIGHT = np.array([0.0, 1.0, 0.0])
BAND = np.linspace(24e9, 30e9, 61)  # [Hz]
LINE = np.stack([5e-3 * (np.arange(41) - 20), np.zeros(41), np.zeros(41)], axis=1)  # [m]


def plane(count: int, step: float) -> np.ndarray:
    line = step * (np.arange(count) - (count - 1) / 2)
    x, z = np.meshgrid(line, line)
    return np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], axis=1)


def wave(
    positions: np.ndarray, point: np.ndarray, extra: float, *, ways: int = 2, seed: int = 0
) -> np.ndarray:
    """One point's wave with a cable's path, at a signal-to-noise ratio of 20 dB."""
    rng = np.random.default_rng(seed)
    distance = np.linalg.norm(positions - point, axis=1)[:, None]
    exact = np.exp(-2j * np.pi * BAND * (ways * distance + extra) / speed_of_light)
    noise = rng.normal(size=exact.shape) + 1j * rng.normal(size=exact.shape)
    return np.asarray(exact + 0.1 * np.sqrt(0.5) * noise)


def judged(samples: np.ndarray, positions: np.ndarray) -> FocusDelay:
    echo = Echo(samples=samples, positions=positions, frequencies=BAND)
    found = focus_delay(echo, BORESIGHT)
    assert found is not None
    return found


@pytest.mark.parametrize("extra", [0.0, 0.6, -0.3])
def test_what_the_delay_has_more_than_the_curvature_is_the_cable_within_its_deviation(
    extra: float,
) -> None:
    point = np.array([0.04, 0.35, 0.0])
    scores = []
    for seed in range(6):
        found = judged(wave(LINE, point, extra, seed=seed), LINE)
        assert found.curvature == pytest.approx(1 / np.linalg.norm(point), rel=0.01)
        assert found.coherence > 0.97  # 20 dB of noise take a hundredth
        scores.append((found.excess - extra) / found.excess_deviation)
    # The root mean square of six standard scores is below 1.8 with a probability of 0.999.
    assert np.sqrt(np.mean(np.square(scores))) < 1.8


def test_a_plane_array_and_a_pilot_tell_it_as_well() -> None:
    positions = plane(15, 5e-3)
    point = np.array([-0.03, 0.25, 0.02])
    samples = wave(positions, point, 0.05, ways=1)
    pilot = Uplink(samples=samples, positions=positions, frequencies=BAND, user="horn")
    found = focus_delay(pilot, BORESIGHT)
    assert found is not None
    assert abs(found.excess - 0.05) < 4 * found.excess_deviation
    assert found.excess_deviation < 2e-3


def test_a_wave_of_the_other_sign_converges() -> None:
    found = judged(wave(LINE, np.array([0.0, 0.3, 0.0]), 0.0).conj(), LINE)
    assert found.curvature < -20 * found.curvature_deviation
    assert found.coherence > 0.97


def test_a_plate_and_a_constant_have_no_curvature_and_two_points_no_single_wave() -> None:
    plate = np.broadcast_to(wave(LINE[:1], np.array([0.0, 0.5, 0.0]), 0.0), (41, 61))
    found = judged(plate.copy(), LINE)
    assert abs(found.curvature) < 4 * found.curvature_deviation + 1e-3
    both = wave(LINE, np.array([-0.1, 0.4, 0.0]), 0.0) + wave(LINE, np.array([0.1, 0.6, 0.0]), 0.0)
    assert judged(both, LINE).coherence < 0.7


def test_arrays_that_tell_no_curvature_give_no_answer() -> None:
    few = LINE[:4]
    assert focus_delay(
        Echo(samples=wave(few, np.array([0.0, 0.3, 0.0]), 0.0), positions=few, frequencies=BAND),
        BORESIGHT,
    ) is None  # fmt: skip
    turn = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    circle = 0.1 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    around = Echo(
        samples=wave(circle, np.array([0.0, 0.02, 0.0]), 0.0), positions=circle, frequencies=BAND
    )
    assert focus_delay(around, BORESIGHT) is None
    # Three positions across are 80 wavelengths: 200,000 directions for each curvature, and aliases.
    sparse = plane(9, 0.4)
    assert focus_delay(
        Echo(samples=wave(sparse, np.array([0.0, 9.0, 0.0]), 0.0), positions=sparse,
             frequencies=BAND),
        BORESIGHT,
    ) is None  # fmt: skip
