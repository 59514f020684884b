"""Samples at which a receiver failed stand out; what is sound is left as it is."""

import re
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.constants import speed_of_light

from estimator.consistency.faulty_samples import without_faults
from estimator.measurement.model import Echo, Uplink

FREQUENCIES = np.linspace(70e9, 76e9, 96)
POINTS = np.array([[0.1, 0.5, 0.0], [-0.2, 0.9, 0.0]])


def line(count: int = 48) -> np.ndarray:
    return np.asarray(np.linspace(-0.05, 0.05, count)[:, None] * np.array([1.0, 0.0, 0.0]))


def echo(positions: np.ndarray, *, noise: float = 0.1, seed: int = 0) -> Echo:
    away = np.linalg.norm(positions[:, None] - POINTS, axis=-1)
    phase = -4 * np.pi / speed_of_light * FREQUENCIES * away[..., None]
    samples = np.exp(1j * phase).sum(axis=1)
    samples = samples + noise * drawn(samples.shape, seed)
    return Echo(samples=samples, positions=positions, frequencies=FREQUENCIES)


def drawn(shape: tuple[int, ...], seed: int) -> np.ndarray:
    rng = np.random.default_rng([22, seed])
    real, imaginary = rng.normal(size=(2, *shape)) / np.sqrt(2)
    return np.asarray(real + 1j * imaginary)


def changed(sound: Echo, where: tuple[Any, ...], level: float, *, kept: float = 0.0) -> Echo:
    samples: Any = sound.samples.copy()
    samples[where] = kept * samples[where] + level * drawn(samples[where].shape, 9)
    return Echo(samples=samples, positions=sound.positions, frequencies=sound.frequencies)


@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0, 30.0])
@pytest.mark.parametrize("seed", range(3))
def test_sound_data_stay_as_they_are_whatever_their_noise(noise: float, seed: int) -> None:
    sound = echo(line(), noise=noise, seed=seed)
    assert without_faults(sound, "echo").data is sound


def test_levels_that_fall_smoothly_over_array_and_band_are_no_faults() -> None:
    sound = echo(line(), noise=0.0)
    # A beam's edge, 60 dB down over 48 positions, and a horn's band edge, 20 dB down.
    fall = 10 ** (-3 * np.linspace(0, 1, 48)[:, None]) * 10 ** (-1 * np.linspace(0, 1, 96))
    beam = Uplink(
        samples=sound.samples * fall, positions=line(), frequencies=FREQUENCIES, user="ann"
    )
    assert without_faults(beam, "pilot").data is beam


def test_a_gain_that_is_too_large_is_no_noise() -> None:
    sound = echo(line())
    louder = Echo(
        samples=sound.samples * np.where(np.arange(48) == 20, 8.0, 1.0)[:, None],
        positions=line(),
        frequencies=FREQUENCIES,
    )
    assert without_faults(louder, "echo").data is louder


@pytest.mark.parametrize(("level", "told"), [(1e-4, "next to nothing"), (20.0, "noise above")])
def test_dead_and_hot_positions_are_left_out_and_told_by_number(level: float, told: str) -> None:
    sound = echo(line())
    bad = [4, 17, 18, 30]
    found = without_faults(changed(sound, (bad,), level, kept=level > 1), "echo")
    assert_array_equal(found.data.positions, np.delete(sound.positions, bad, axis=0))
    assert_array_equal(found.data.samples, np.delete(sound.samples, bad, axis=0))
    (note,) = found.notes
    assert re.search(rf"echo holds {told}.* 4 positions of 48 \(number 5, 18, 19, …\)", note)


def test_transmitters_are_left_out_with_their_receivers() -> None:
    positions = line()
    apart = Echo(
        samples=changed(echo(positions), ([7],), 1e-4).samples,
        positions=positions,
        frequencies=FREQUENCIES,
        transmit_positions=positions + np.array([0.0, 0.0, 0.1]),
    )
    found = without_faults(apart, "echo").data
    assert found.transmit_positions is not None
    assert len(found.transmit_positions) == len(found.samples) == 47


def test_a_planar_array_keeps_its_grid_and_is_silent_where_it_was_hot() -> None:
    x, z = (one.ravel() for one in np.meshgrid(np.linspace(-0.05, 0.05, 8), np.arange(8) / 100))
    grid = np.stack([x, 0 * x, z], axis=-1)
    found = without_faults(changed(echo(grid), ([9, 50],), 30.0), "echo").data
    assert_array_equal(found.positions, grid)
    assert_array_equal(np.flatnonzero(np.all(found.samples == 0, axis=1)), [9, 50])


@pytest.mark.parametrize("bad", [[40], [10, 11, 50, 70, 90]])
def test_noise_at_some_frequencies_is_replaced_by_what_the_others_say(bad: list[int]) -> None:
    sound = echo(line(), noise=0.0)
    found = without_faults(changed(sound, (slice(None), bad), 15.0, kept=1.0), "echo")
    good = np.delete(np.arange(96), bad)
    assert_array_equal(found.data.samples[:, good], sound.samples[:, good])
    # Two points of amplitude 1, and noise of 15 that is gone: 40 dB less; a band's end is continued
    # least well.
    error = np.sqrt(np.mean(np.abs(found.data.samples - sound.samples)[:, bad] ** 2))
    assert error < 0.01 * 15 * np.sqrt(2)
    (note,) = found.notes
    assert f"at {len(bad)} frequenc" in note
    assert f"{FREQUENCIES[bad[0]] / 1e9:.6g}" in note


def test_where_more_than_half_failed_nothing_is_left_out() -> None:
    dead = changed(echo(line()), (np.arange(0, 48, 5) + np.arange(3)[:, None],), 1e-4)
    assert len(without_faults(dead, "echo").data.samples) == 48


def test_of_few_positions_none_stands_out() -> None:
    few = changed(echo(line(12)), ([3],), 1e-4)
    assert without_faults(few, "echo").data is few


def test_clipped_samples_are_told_and_kept() -> None:
    sound = echo(line(), noise=0.01)
    flat = sound.samples.real.clip(-1.5, 1.5) + 1j * sound.samples.imag.clip(-1.5, 1.5)
    clipped = Echo(samples=flat / 3, positions=sound.positions, frequencies=FREQUENCIES)
    found = without_faults(clipped, "echo")
    outside = np.maximum(np.abs(sound.samples.real), np.abs(sound.samples.imag)) >= 1.5
    assert_array_equal(found.data.samples, clipped.samples)
    (note,) = found.notes
    assert f"echo is clipped: {100 * outside.mean():.2g} % of its samples" in note


def test_integers_of_a_converter_are_not_clipped_by_being_few() -> None:
    sound = echo(line(), noise=1.0)
    counts = np.round(10 * sound.samples)  # some 40 levels: the largest has several samples
    coarse = Echo(samples=counts / 7.0, positions=line(), frequencies=FREQUENCIES)
    assert without_faults(coarse, "echo").data is coarse
