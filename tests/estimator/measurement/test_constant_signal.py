"""What all positions share is measured and taken out; what is left is the scene."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.measurement.constant_signal import (
    shared_signal,
    without_delays,
    without_shared_signal,
)
from estimator.measurement.model import Echo, MeasurementError

FREQUENCIES = np.linspace(8e9, 12e9, 81)  # [Hz]
POSITIONS = np.stack([0.01 * np.arange(41) - 0.2, np.zeros(41), np.zeros(41)], axis=1)  # [m]
DELAY = 2 * np.linalg.norm(POSITIONS - [0.05, 0.5, 0.0], axis=1)[:, None] / speed_of_light
POINT = 1e-4 * np.exp(-2j * np.pi * FREQUENCIES * DELAY)


def echo(samples: np.ndarray) -> Echo:
    return Echo(samples=samples, positions=POSITIONS, frequencies=FREQUENCIES)


@pytest.mark.parametrize("path", [0.15, -0.4])
def test_a_constant_is_told_by_its_level_and_delay_also_before_the_reference_plane(
    path: float,
) -> None:
    leak = 0.1 * np.exp(-2j * np.pi * FREQUENCIES * path / speed_of_light)
    found = shared_signal(echo(POINT + leak))
    assert found is not None
    # The point's own mean over 13 turns of delay is a fraction of it.
    assert found.above_rest_db == pytest.approx(60, abs=0.3)
    # An eighth of a cell of c/B.
    assert found.path == pytest.approx(path, abs=speed_of_light / 4e9 / 8)
    alone = shared_signal(echo(POINT))
    assert alone is not None
    assert alone.above_rest_db < -5


def test_the_mean_leaves_the_point_and_two_components_a_leak_that_drifts() -> None:
    leak = 0.1 * np.exp(-2j * np.pi * FREQUENCIES * 0.15 / speed_of_light)
    left = without_shared_signal(echo(POINT + leak))
    # A leak of 1000 times the point is gone to rounding; a 41st of the point is its mean.
    np.testing.assert_allclose(left.samples, POINT - POINT.mean(axis=0), atol=1e-16)
    warm = 1 + 0.05 * np.linspace(-1, 1, 41)[:, None]  # the cable warms up
    drifting = echo(POINT + warm * leak)
    mean = without_shared_signal(drifting).samples
    parts = without_shared_signal(drifting, components=1).samples
    lost = [
        np.mean(np.abs(one - POINT) ** 2) / np.mean(np.abs(POINT) ** 2) for one in (mean, parts)
    ]
    assert lost[0] > 100
    assert lost[1] < 0.1


def test_a_gate_takes_the_mismatch_with_its_side_lobes_and_leaves_the_point() -> None:
    ripple = 0.7 + 0.3 * np.cos(2 * np.pi * FREQUENCIES / 0.9e9)
    mismatch = 0.18 * ripple * np.exp(-2j * np.pi * FREQUENCIES * 0.1e-9)
    left = without_delays(echo(POINT + mismatch), -1.3e-9, 1.5e-9)
    # 0.18 by ε = 1e-7 lies far below the point. The point, n = 7 cells of 1/B away from the gate,
    # loses what its side lobes have there: an amplitude of up to 1/2 at the band's ends, and
    # 1/2πnx at a part x of the band from an end: 0.09 and 0.03 at a quarter.
    inner = slice(20, -20)
    error = np.abs(left.samples - POINT)[:, inner] / 1e-4
    assert error.max() < 0.12
    assert np.mean(np.abs(left.samples - POINT) ** 2) / 1e-8 < 0.1


def test_what_cannot_be_taken_out_is_told() -> None:
    few = Echo(samples=POINT[:4], positions=POSITIONS[:4], frequencies=FREQUENCIES)
    assert shared_signal(few) is None
    with pytest.raises(MeasurementError, match="4 positions share too much"):
        without_shared_signal(few)
    with pytest.raises(MeasurementError, match="41 principal components of 41"):
        without_shared_signal(echo(POINT), components=41)
    with pytest.raises(MeasurementError, match=r"a gate of 2 … 1 ns; it must rise"):
        without_delays(echo(POINT), 2e-9, 1e-9)
    with pytest.raises(MeasurementError, match=r"shorter than the unambiguous delay of 20 ns"):
        without_delays(echo(POINT), 0.0, 21e-9)
    many = np.linspace(8e9, 12e9, 2049)
    long = Echo(
        samples=np.ones((5, 2049), dtype=complex), positions=POSITIONS[:5], frequencies=many
    )
    with pytest.raises(MeasurementError, match="a gate of 2049 frequencies; at most 2048"):
        without_delays(long, 0.0, 1e-9)
