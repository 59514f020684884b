"""Waves taken out of a pilot: direct, reflected, scattered, and beyond the unambiguous length."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.channel.angle_range_map_2d import (
    angle_range_map,
    default_angles,
    default_path_lengths,
)
from estimator.channel.path import LEAST_SHARE, Path
from estimator.channel.path_extraction_2d import find_paths
from estimator.measurement.model import Uplink
from estimator.wavefronts.curvature_search_2d import search_curvature
from estimator.wavefronts.noise_variance import noise_variance

COUNT = 64
BAND = np.linspace(220e9, 295e9, 126)  # 0.5 m of unambiguous path
UNAMBIGUOUS = speed_of_light / 600e6


def source(aoa_deg: float, distance: float) -> Float[np.ndarray, " 3"]:
    aoa = np.radians(aoa_deg)
    return distance * np.array([np.cos(aoa), np.sin(aoa), 0.0])


def waves(world: Any, samples: Complex[np.ndarray, "elements freqs"]) -> tuple[Path, ...]:
    uplink = Uplink(samples=samples, positions=world.array(COUNT), frequencies=BAND, user="a")
    chart = angle_range_map(
        uplink,
        aoa=default_angles(uplink, cells=1.5),
        path_length=default_path_lengths(uplink, cells=1.5),
        centre=np.zeros(3),
    )
    return find_paths(uplink, chart).paths


def pilot(world: Any, place: Float[np.ndarray, " 3"], *, extra: float = 0.0) -> Any:
    return world.pilot(place, positions=world.array(COUNT), frequencies=BAND, extra=extra)


def test_a_user_in_sight_is_one_specular_wave_with_all_the_energy(world: Any) -> None:
    samples = world.noisy(pilot(world, source(63.0, 0.4)), 20.0, np.random.default_rng(1))
    (path,) = waves(world, samples)
    assert path.specular
    assert path.share == pytest.approx(1.0, abs=0.02)
    deviation = np.sqrt(np.diag(path.wave.covariance))
    assert abs(path.wave.bearing[0] - np.radians(63.0)) <= 5 * deviation[0]
    assert abs(path.wave.path_length - 0.4) <= 5 * deviation[1]
    assert path.unambiguous == pytest.approx(UNAMBIGUOUS)


def test_two_paths_are_told_apart_with_their_shares(world: Any) -> None:
    strong, weak = pilot(world, source(70.0, 0.3)), pilot(world, source(100.0, 0.42))
    weak = weak * 0.6 * np.linalg.norm(strong) / np.linalg.norm(weak)
    samples = world.noisy(strong + weak, 20.0, np.random.default_rng(2))
    first, second = waves(world, samples)
    assert first.specular
    assert second.specular
    np.testing.assert_allclose(
        np.degrees([first.wave.bearing[0], second.wave.bearing[0]]), [70.0, 100.0], atol=0.02
    )
    np.testing.assert_allclose(
        [first.wave.path_length, second.wave.path_length], [0.3, 0.42], atol=1e-4
    )
    # They are all but orthogonal: the shares are those of 1 : 0.36.
    np.testing.assert_allclose([first.share, second.share], [1 / 1.36, 0.36 / 1.36], atol=0.02)


@pytest.mark.parametrize("behind", [0.1, 0.2])
def test_a_wave_that_an_edge_scatters_is_rounder_than_its_delay(behind: float, world: Any) -> None:
    edge = source(75.0, 0.15)
    samples = world.noisy(pilot(world, edge, extra=behind), 20.0, np.random.default_rng(3))
    path = max(waves(world, samples), key=lambda one: one.share)
    assert not path.specular
    assert path.dealiased_length is None
    assert path.radius == pytest.approx(0.15, rel=0.02)
    assert path.free.path_length == pytest.approx(0.15 + behind, abs=1e-3)


@pytest.mark.parametrize("length", [0.65, 0.75, 0.9])
def test_a_wave_from_beyond_the_unambiguous_length_is_flatter_than_its_delay(
    length: float, world: Any
) -> None:
    samples = world.noisy(pilot(world, source(95.0, length)), 20.0, np.random.default_rng(4))
    path = max(waves(world, samples), key=lambda one: one.share)
    assert path.free.path_length == pytest.approx(length - UNAMBIGUOUS, abs=1e-3)
    assert not path.specular
    assert path.dealiased_length == pytest.approx(length, abs=1e-2)


def test_noise_alone_holds_no_wave(world: Any) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        noise = rng.standard_normal((COUNT, BAND.size)) + 1j * rng.standard_normal(
            (COUNT, BAND.size)
        )
        assert waves(world, noise) == ()


def test_a_wave_far_below_the_noise_of_a_sample_is_found_by_the_whole_array(world: Any) -> None:
    # −10 dB in each of 8064 samples is 29 dB after the filter.
    samples = world.noisy(pilot(world, source(80.0, 0.35)), -10.0, np.random.default_rng(6))
    (path,) = waves(world, samples)
    # Cramér-Rao at 29 dB: about 0.05° and 0.05 mm.
    assert np.degrees(path.wave.bearing[0]) == pytest.approx(80.0, abs=0.3)
    assert path.wave.path_length == pytest.approx(0.35, abs=1e-3)
    assert path.specular


def test_what_is_weaker_than_the_least_share_is_not_looked_at(world: Any) -> None:
    strong, weak = pilot(world, source(70.0, 0.3)), pilot(world, source(100.0, 0.42))
    share = 0.5 * LEAST_SHARE
    weak = weak * np.sqrt(share) * np.linalg.norm(strong) / np.linalg.norm(weak)
    assert len(waves(world, world.noisy(strong + weak, 40.0, np.random.default_rng(2)))) == 1


def test_the_noise_is_measured_beside_the_signal(world: Any) -> None:
    rng = np.random.default_rng(7)
    clean = pilot(world, source(80.0, 0.35))
    power = float(np.mean(np.abs(clean) ** 2))
    for snr_db in (0.0, 20.0):
        uplink = Uplink(
            samples=world.noisy(clean, snr_db, rng),
            positions=world.array(COUNT),
            frequencies=BAND,
            user="a",
        )
        level = 10 ** (-snr_db / 10)
        # The sidelobes of a wave between two of the 126 delays have a median of up to 2.3 % of
        # its power; they lift that of the noise by some of it, and hide noise far below.
        # A median of 8064 exponential variables is known to 1.1 %: four of them.
        found = noise_variance(uplink.samples) / power
        assert (1 - 0.045) * level <= found <= (1 + 0.045) * level + 3 * 0.023


@settings(deadline=None, max_examples=8)
@given(
    aoa_deg=st.floats(60, 120),
    length=st.floats(0.2, 0.45),
    radius=st.sampled_from([0.08, 0.15, 0.3, 0.7, 3.0]),
)
def test_the_search_starts_within_the_summit_of_any_curvature(
    world: Any, aoa_deg: float, length: float, radius: float
) -> None:
    place = source(aoa_deg, radius)
    uplink = Uplink(
        samples=pilot(world, place, extra=length - radius),
        positions=world.array(COUNT),
        frequencies=BAND,
        user="a",
    )
    start = search_curvature(uplink, aoa=np.radians(aoa_deg), path_length=length)
    beam = speed_of_light / 257.5e9 / 31.5e-3
    assert abs(np.cos(start.aoa) - np.cos(np.radians(aoa_deg))) <= beam
    assert abs(start.path_length - length) <= speed_of_light / 75e9
    # The grid of radii is a radian of sagitta apart: k·h²·sin²θ/2 · Δ(1/R).
    sagitta = 0.5 * 2 * np.pi * 257.5e9 / speed_of_light * 15.75e-3**2
    assert abs(1 / start.radius - 1 / radius) <= 2.0 / (sagitta * np.sin(np.radians(60)) ** 2)


@pytest.mark.parametrize("reached", [slice(0, 30), slice(26, 64), slice(14, 52)])
def test_a_wave_that_an_edge_shadows_is_one_wave_from_its_true_source(
    world: Any, reached: slice
) -> None:
    place = source(75.0, 0.38)
    samples = pilot(world, place)
    lit = np.zeros(COUNT, dtype=bool)
    lit[reached] = True
    samples[~lit] *= 0.03
    (path,) = waves(world, world.noisy(samples, 15.0, np.random.default_rng(5)))
    assert path.shadow is not None
    # The median over five elements moves an edge by two at most.
    assert np.count_nonzero(path.shadow.lit != lit) <= 4
    np.testing.assert_allclose(path.shadow.reached, world.array(COUNT)[lit].mean(axis=0), atol=1e-3)
    assert path.specular
    assert path.share == pytest.approx(1.0, abs=0.03)
    errors = np.array([path.wave.bearing[0] - np.radians(75.0), path.wave.path_length - 0.38])
    square = errors @ np.linalg.solve(path.wave.covariance, errors)
    assert square < 13.8  # χ² of two: one in a thousand


def test_two_waves_and_a_bent_front_are_no_shadow(world: Any) -> None:
    rng = np.random.default_rng(7)
    both = pilot(world, source(70.0, 0.3)) + 0.8 * pilot(world, source(74.0, 0.3))
    bent = pilot(world, source(80.0, 0.35)) * np.exp(0.5j * rng.standard_normal((COUNT, 1)))
    for samples in (both, bent):
        assert all(path.shadow is None for path in waves(world, samples))
