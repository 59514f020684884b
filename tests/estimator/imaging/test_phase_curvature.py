"""Curvature and coherence of wavefronts, on waves that are written in closed form."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.array.linear_array import echo_resolution
from estimator.geometry.wall_2d import mirrored
from estimator.imaging.phase_curvature import BENDS, bent_intensities, coherence_factor
from estimator.imaging.range_compression import RangeProfiles, range_profiles
from estimator.measurement.model import Echo

POINT = np.array([0.05, 0.33, 0.0])
WALL = np.array([-0.1, 0.1, 0.0]), np.array([0.1, 0.3, 0.0])  # 45° through (0, 0.2)


def profiles_of(world: Any, lengths: Float[np.ndarray, " positions"]) -> RangeProfiles:
    """Profiles of waves of unit strength with these whole ways."""
    samples = np.exp(-2j * np.pi * world.band / speed_of_light * lengths[:, None])
    return range_profiles(Echo(samples=samples, positions=world.array(), frequencies=world.band))


def of_samples(world: Any, samples: Complex[np.ndarray, "m f"]) -> RangeProfiles:
    return range_profiles(Echo(samples=samples, positions=world.array(), frequencies=world.band))


def resolution(world: Any) -> Any:
    anything = np.ones((len(world.array()), world.band.size), dtype=np.complex128)
    return echo_resolution(Echo(samples=anything, positions=world.array(), frequencies=world.band))


def shares(world: Any, ready: RangeProfiles, point: Float[np.ndarray, " 3"], flat: bool) -> float:
    found = coherence_factor(ready, point[None], resolution(world), flat=flat, noise=0.0)
    return float(found[0])


@pytest.mark.parametrize("aside", [-0.2, 0.0, 0.15])
def test_the_wave_of_a_point_is_not_bent_and_is_one_wave(world: Any, aside: float) -> None:
    point = np.array([aside, 0.3, 0.0])
    ready = profiles_of(world, 2 * np.linalg.norm(point - world.array(), axis=-1))
    tried = bent_intensities(ready, point[None], resolution(world))[0]
    assert int(np.argmax(tried)) == 0
    assert tried[0] == pytest.approx(1.0, rel=1e-3)  # what back-projection promises
    assert np.all(np.diff(tried[:4]) < 0)
    # One wave over the whole aperture; its range profile has the same phase everywhere.
    assert shares(world, ready, point, flat=False) == pytest.approx(1.0, abs=1e-3)


def test_a_wave_that_a_facet_scatters_on_its_way_is_bent_as_its_length_says(world: Any) -> None:
    # Out over a facet of the wall, back over the mirror: as if from the target's image.
    positions = world.array()
    target = np.array([0.18, 0.22, 0.0])
    image = mirrored(target, *WALL)
    facet = np.array([-0.015, 0.185, 0.0])
    out = np.linalg.norm(positions - facet, axis=-1) + np.linalg.norm(facet - target)
    lengths = out + np.linalg.norm(positions - image, axis=-1)
    # Where it appears: half the length, half-way between the two directions.
    reach = 0.5 * (np.linalg.norm(facet) + np.linalg.norm(facet - target) + np.linalg.norm(image))
    sine = 0.5 * (facet[0] / np.linalg.norm(facet) + image[0] / np.linalg.norm(image))
    place = reach * np.array([sine, np.sqrt(1 - sine**2), 0.0])
    tried = bent_intensities(profiles_of(world, lengths), place[None], resolution(world))[0]
    curvature = 0.5 * sum(
        (1 - (p[0] / np.linalg.norm(p)) ** 2) / np.linalg.norm(p) for p in (facet, image)
    )
    wavenumber = 2 * np.pi * world.band.mean() / speed_of_light
    half = 0.5 * np.ptp(positions[:, 0])
    expected = wavenumber * half**2 * (curvature - (1 - sine**2) / reach)
    assert expected > 3.0
    # The grid's step is 2 rad.
    assert BENDS[int(np.argmax(tried))] == pytest.approx(expected, abs=np.diff(BENDS)[0])
    assert tried.max() > 1.2 * tried[0]


def test_a_mirror_that_faces_the_array_returns_a_wave_without_curvature(world: Any) -> None:
    lengths = np.full(len(world.array()), 0.6)
    ready, foot = profiles_of(world, lengths), np.array([0.0, 0.3, 0.0])
    # A point's sphere leaves the range cell by h²/R = 1.9 mm at the ends, half its width.
    assert shares(world, ready, foot, flat=True) == pytest.approx(1.0, abs=2e-2)
    assert shares(world, ready, foot, flat=False) < 0.6
    tried = bent_intensities(ready, foot[None], resolution(world))[0]
    assert int(np.argmax(tried)) == 0  # less curvature than a point's, never more


def test_what_half_of_the_array_sees_is_half_coherent(world: Any) -> None:
    lengths = 2 * np.linalg.norm(POINT - world.array(), axis=-1)
    samples = np.exp(-2j * np.pi * world.band / speed_of_light * lengths[:, None])
    samples[: len(samples) // 2] = 0
    ready = of_samples(world, samples)
    assert shares(world, ready, POINT, flat=False) == pytest.approx(0.5, abs=1e-3)


def test_noise_is_no_wave_and_does_not_hide_one(world: Any) -> None:
    rng = np.random.default_rng(0)
    count = len(world.array())
    noise = (rng.standard_normal((2, count, world.band.size)) * np.sqrt(0.5)).T
    noise = (noise[..., 0] + 1j * noise[..., 1]).T
    # Alone: 1/M in the mean, tried at three ranges; e^-8 to be above 8/M at each.
    assert shares(world, of_samples(world, noise), POINT, flat=False) < 8 / count
    lengths = 2 * np.linalg.norm(POINT - world.array(), axis=-1)
    wave = np.exp(-2j * np.pi * world.band / speed_of_light * lengths[:, None])
    weak = of_samples(world, noise + wave / np.sqrt(world.band.size))
    # As strong as the noise of each profile: half of the energy, all of it once noise is out.
    assert shares(world, weak, POINT, flat=False) == pytest.approx(0.5, abs=0.15)
    found = coherence_factor(
        weak, POINT[None], resolution(world), flat=False, noise=float(world.band.size)
    )
    assert found[0] == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("stronger", [10.0, 30.0])
def test_what_stands_at_the_range_of_something_brighter_is_one_wave_all_the_same(
    world: Any, stronger: float
) -> None:
    positions = world.array()
    bright = np.array([-0.2, np.sqrt(np.sum(POINT**2) - 0.2**2), 0.0])  # as far away, 0.27 m aside
    samples = sum(
        level
        * np.exp(
            -4j * np.pi * world.band / speed_of_light
            * np.linalg.norm(place - positions, axis=-1)[:, None]
        )
        for place, level in ((POINT, 1.0), (bright, stronger))
    )  # fmt: skip
    ready = of_samples(world, samples)
    # The other's range differs over the aperture: it is met by some 5 of 96 channels, and there
    # has 5 and 47 times the energy. 32 cells aside a Hann window has no sidelobes to speak of; the
    # profiles err by -54 to -67 dB.
    assert shares(world, ready, POINT, flat=False) > 0.9
    assert shares(world, ready, bright, flat=False) > 0.9
    # Between both there is nothing but sidelobes: of the two waves, in their own directions.
    between = 0.5 * (POINT + bright)
    between *= np.linalg.norm(POINT) / np.linalg.norm(between)
    assert shares(world, ready, between, flat=False) < 0.3


def test_two_waves_within_a_few_beams_share_what_stands_there(world: Any) -> None:
    positions = world.array()
    beam = speed_of_light / 257.5e9 / (2 * np.ptp(positions[:, 0]))
    sine = POINT[0] / np.linalg.norm(POINT) + 4 * beam
    other = np.linalg.norm(POINT) * np.array([sine, np.sqrt(1 - sine**2), 0.0])
    samples = sum(
        np.exp(
            -4j * np.pi * world.band / speed_of_light
            * np.linalg.norm(place - positions, axis=-1)[:, None]
        )
        for place in (POINT, other)
    )  # fmt: skip
    assert shares(world, of_samples(world, samples), POINT, flat=False) == pytest.approx(
        0.5, abs=0.1
    )
