"""Waves that converge are of the other time convention; waves in closed form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.consistency.time_convention import (
    BRIGHTER,
    brighter_conjugated,
    refuse_other_convention,
)
from estimator.localization.pipeline import locate
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink

PLACES = {
    "points": np.array([[0.06, 0.15, 0.0], [-0.05, 0.20, 0.0]]),
    "one near": np.array([[0.02, 0.08, 0.0]]),
}


def conjugated(data: Any) -> Any:
    return replace(data, samples=data.samples.conj())


def pilot(user: np.ndarray, world: Any, *, late: float = 0.0) -> Uplink:
    """A direct wave; ``late``: what a clock adds to its path [m]."""
    positions = world.array(96)
    lengths = np.linalg.norm(user - positions, axis=1) + late
    turns = np.exp(-2j * np.pi / speed_of_light * np.outer(lengths, world.band))
    return Uplink(samples=turns, positions=positions, frequencies=world.band, user="ann")


@pytest.mark.parametrize("places", PLACES.values(), ids=PLACES)
def test_an_echo_is_focused_as_it_is_and_its_conjugate_is_refused(
    places: np.ndarray, world: Any
) -> None:
    echo = world.echo(places, np.random.default_rng(1))
    assert brighter_conjugated(echo) <= 1
    with pytest.raises(MeasurementError, match=r"echo: all waves converge.*exp\(-jwt\)"):
        refuse_other_convention(conjugated(echo), "echo")


def test_a_planar_array_is_told_by_its_middle_row_and_column(world: Any) -> None:
    line = 0.5e-3 * (np.arange(96) - 47.5)
    x, z = np.meshgrid(line, line, indexing="ij")
    positions = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)
    band = world.band[::2]
    # From aside and above: neither line looks at it.
    place = np.array([0.03, 0.08, 0.02])
    echo = world.echo(place[None], np.random.default_rng(1), positions=positions, frequencies=band)
    waves = np.exp(
        -2j * np.pi / speed_of_light * np.linalg.norm(place - positions, axis=-1)[:, None] * band
    )
    user = Uplink(samples=waves, positions=positions, frequencies=band, user="ann")
    for data in (echo, user):
        assert brighter_conjugated(data) <= 1
        assert brighter_conjugated(conjugated(data)) > BRIGHTER
    other = conjugated(user)
    with pytest.raises(MeasurementError, match="uplink of 'ann': all waves converge"):
        locate(Measurement(echo=None, uplinks=(other,), clock_offset=0.0))
    # A row in the array's plane, elsewhere than its middle, is bent alike; order does not count.
    mixed = np.random.default_rng(3).permutation(len(positions))
    again = replace(user, samples=waves[mixed], positions=positions[mixed])
    assert brighter_conjugated(again) == pytest.approx(brighter_conjugated(user))


def test_the_ratio_of_the_conjugate_is_the_inverse_of_its_own(world: Any) -> None:
    echo = world.echo(PLACES["points"], np.random.default_rng(2))
    again = brighter_conjugated(conjugated(echo))
    # Profiles are polynomials in single precision, read at other places: -54 dB of the peak.
    assert brighter_conjugated(echo) * again == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("late", [0.0, 0.2, 0.5, 0.9])
def test_a_pilot_diverges_whatever_its_clock(late: float, world: Any) -> None:
    near = pilot(np.array([0.05, 0.12, 0.0]), world, late=late)
    # No brighter than a flat wave, but for the directions between those that are tried.
    assert brighter_conjugated(near) <= 1.1


def test_a_pilot_of_the_other_convention_is_refused_before_any_work(world: Any) -> None:
    other = conjugated(pilot(np.array([0.05, 0.12, 0.0]), world))
    assert brighter_conjugated(other) > BRIGHTER
    with pytest.raises(MeasurementError, match="uplink of 'ann': all waves converge"):
        locate(Measurement(echo=None, uplinks=(other,), clock_offset=0.0))


def test_flat_waves_tell_nothing(world: Any) -> None:
    far = pilot(np.array([100.0, 900.0, 0.0]), world)
    facing = Echo(
        samples=np.tile(
            np.exp(-4j * np.pi * world.band * 0.1 / speed_of_light), (len(far.positions), 1)
        ),
        positions=far.positions,
        frequencies=world.band,
    )
    for data in (far, facing, conjugated(far), conjugated(facing)):
        assert 0.8 < brighter_conjugated(data) < 1.25


@pytest.mark.parametrize("seed", range(5))
def test_noise_tells_nothing(seed: int, world: Any) -> None:
    rng = np.random.default_rng([3, seed])
    samples = rng.normal(size=(2, 96, world.band.size))
    noise = Echo(
        samples=samples[0] + 1j * samples[1], positions=world.array(96), frequencies=world.band
    )
    # Maxima of some thousand exponential variables.
    assert 0.5 < brighter_conjugated(noise) < 2
