"""Autofocus of positions: the image as sharp as with the true ones, by its entropy."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float

from estimator.imaging.autofocus import contributions, focus_ranges
from estimator.measurement.model import Echo, MeasurementError
from validation.analytic.point_scatterer import complex_noise, point_echo
from validation.metrics.image_quality import image_entropy

AHEAD = np.array([0.0, 1.0, 0.0])
BAND = np.linspace(285e9, 315e9, 31)  # cells of 5 mm, unambiguous to 0.15 m more


def line(count: int = 60) -> Float[np.ndarray, "positions 3"]:
    x = (np.arange(count) - (count - 1) / 2) * 0.45e-3
    return np.stack([x, 0 * x, 0 * x], axis=-1)


def pixels() -> Float[np.ndarray, "points 3"]:
    x, y = np.meshgrid(np.arange(-0.02, 0.02, 1e-3), np.arange(0.13, 0.19, 2e-3))
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=-1)


def entropy(echo: Echo) -> float:
    return image_entropy(contributions(echo, pixels()).sum(axis=0))


def noisy_echo(
    positions: Float[np.ndarray, "positions 3"], targets: list[list[float]], seed: int
) -> Echo:
    clean = point_echo(
        np.array(targets),
        positions=positions,
        frequencies=BAND,
        radar_cross_section=np.full(len(targets), 1e-3),
    )
    level = 0.1 * float(np.sqrt(np.mean(np.abs(clean.samples) ** 2)))  # 20 dB
    noise = complex_noise(clean.samples.shape, level**2, np.random.default_rng(seed))
    return replace(clean, samples=clean.samples + noise)


TARGETS = [
    [[0.004, 0.16, 0.0]],
    [[0.004, 0.16, 0.0], [-0.006, 0.15, 0.0], [0.0, 0.171, 0.0]],
]


@pytest.mark.parametrize("targets", TARGETS)
def test_jitter_of_a_rail_is_taken_out_to_the_sharpness_of_the_truth(
    targets: list[list[float]],
) -> None:
    rng = np.random.default_rng(11)
    stated = line()
    true = stated + 1e-4 * rng.normal(size=len(stated))[:, None] * AHEAD  # λ/10 at 300 GHz
    real = noisy_echo(true, targets, 3)
    blurred = replace(real, positions=stated)
    found = focus_ranges(blurred, pixels(), AHEAD)
    assert entropy(blurred) > 1.1 * entropy(real)
    assert entropy(found.echo) < 1.02 * entropy(real)
    off = found.shift - (true - stated)[:, 1]
    columns = np.stack([np.ones(len(stated)), stated[:, 0]], axis=1)
    off = off - columns @ np.linalg.lstsq(columns, off)[0]
    # The phase of one position at 20 dB in each of 31 samples errs by 0.1/√62 rad: 1 µm; the
    # others' share of its pixels adds some.
    assert np.std(off) < 5e-6


def test_true_positions_stay_where_they_are() -> None:
    real = noisy_echo(line(), TARGETS[1], 4)
    found = focus_ranges(real, pixels(), AHEAD)
    assert np.sqrt(np.mean(found.shift**2)) < 5e-6
    assert abs(entropy(found.echo) / entropy(real) - 1) < 0.005


def test_a_shift_and_a_tilt_of_the_array_are_left() -> None:
    real = noisy_echo(line(), TARGETS[0], 5)
    tilted = line() + (0.3e-3 + 0.01 * line()[:, :1]) * AHEAD
    found = focus_ranges(replace(real, positions=tilted), pixels(), AHEAD)
    # What is left of them within a wavelength's phase: the image moves, and stays as sharp.
    assert entropy(found.echo) < 1.02 * entropy(real)
    assert abs(np.polyfit(line()[:, 0], found.shift, 1)).max() < 1e-9


def test_more_terms_than_are_affordable_are_refused() -> None:
    real = noisy_echo(line(), TARGETS[0], 7)
    with pytest.raises(MeasurementError, match=r"autofocus: .* terms to sum, more than 2e"):
        focus_ranges(real, np.zeros((2_000_000, 3)), AHEAD)
