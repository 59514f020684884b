"""How a path's level tilts over the band: not at all in free space, by what absorbs otherwise."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.channel.level_tilt import FEWEST, with_level_tilts
from estimator.channel.path import Path, PathSet
from estimator.measurement.model import Uplink
from estimator.positioning.level_likelihood import MOST_BY_TILT, by_tilt
from estimator.wavefronts.wave_fit_2d import SphericalWave

FREQUENCIES = np.linspace(220e9, 295e9, 201)
USER = np.array([0.3, 0.7, 0.0])


def pilot(loss_db: Float[np.ndarray, " freqs"], *, noise: float = 0.0) -> Uplink:
    positions = np.zeros((48, 3))
    positions[:, 0] = (np.arange(48) - 23.5) * 1e-3
    far = np.linalg.norm(positions - USER, axis=-1)[:, None]
    samples = speed_of_light / (4 * np.pi * far * FREQUENCIES)
    samples = samples * np.exp(-2j * np.pi * far * FREQUENCIES / speed_of_light)
    rng = np.random.default_rng(3)
    level = noise * float(np.abs(samples).mean()) / np.sqrt(2)
    added = rng.standard_normal((2, *samples.shape))
    samples = samples * 10 ** (-loss_db / 20) + level * (added[0] + 1j * added[1])
    return Uplink(user="ann", samples=samples, positions=positions, frequencies=FREQUENCIES)


def paths() -> PathSet:
    length = float(np.linalg.norm(USER))
    wave = SphericalWave(
        aoa=float(np.arctan2(USER[1], USER[0])),
        path_length=length,
        radius=length,
        gain=1.0 + 0.0j,
        covariance=np.diag([1e-8, 1e-8, 1e-4]),
        explained=0.9,
    )
    one = Path(wave=wave, free=wave, share=0.9, unambiguous=0.8)
    return PathSet(paths=(one,), covariance=np.eye(2), free_covariance=np.eye(3))


def tilt(uplink: Uplink) -> float:
    told = with_level_tilts(uplink, paths()).paths[0].tilt_db
    assert told is not None
    return told


def test_free_space_has_no_tilt_and_neither_has_a_loss_that_is_alike_over_the_band() -> None:
    for loss in (0.0, 6.0):
        assert tilt(pilot(np.full(FREQUENCIES.size, loss))) == pytest.approx(0.0, abs=0.05)


def test_absorption_by_the_power_of_the_frequency_tilts_by_its_slope_also_in_noise() -> None:
    absorbed = 16.0 * (FREQUENCIES / 257.5e9) ** 1.34
    line = np.polyfit(FREQUENCIES, absorbed, 1)[0] * np.ptp(FREQUENCIES)
    # The gate bends the level where the band ends.
    assert tilt(pilot(absorbed)) == pytest.approx(-line, rel=0.05)
    # 0 dB of noise per sample: gated and averaged over the array some 30 dB below.
    assert tilt(pilot(absorbed, noise=10 ** (-16 / 20))) == pytest.approx(-line, abs=0.5)


def test_of_few_or_uneven_frequencies_nothing_is_told() -> None:
    whole = pilot(np.zeros(FREQUENCIES.size))
    few = replace(
        whole,
        samples=whole.samples[:, : FEWEST - 1],
        frequencies=whole.frequencies[: FEWEST - 1],
    )
    assert with_level_tilts(few, paths()).paths[0].tilt_db is None


def test_a_flat_level_speaks_for_free_space_and_a_steep_one_for_a_pane() -> None:
    band = (257.5e9, 75e9)
    assert by_tilt(-0.2, *band, way="through", over="reflected") < 0.1
    assert by_tilt(-5.5, *band, way="through", over="reflected") > 5
    assert by_tilt(-0.05, *band, way="reflected", over="direct") < 0.1
    assert by_tilt(-1.5, *band, way="reflected", over="direct") > 10
    assert by_tilt(-20.0, *band, way="through", over="direct") == MOST_BY_TILT
    # A narrow band tells nothing: every slope over it is small.
    narrow = (60e9, 0.2e9)
    assert by_tilt(0.0, *narrow, way="reflected", over="direct") == pytest.approx(1.0, abs=0.1)
    assert 0.2 < by_tilt(0.0, *narrow, way="through", over="direct") < 5
