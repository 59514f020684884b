"""Channels in the axis order of Sionna PHY give back what was measured."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light
from sionna.rt import subcarrier_frequencies

import mmslam
from estimator.measurement.model import MeasurementError
from scenes.scenario import parse_scenario

ELEMENTS, DELAY = 5, 40e-9


def measured(*, points: int = 64, users: tuple[str, ...] = ("ann", "bob")) -> mmslam.Measurement:
    """Make pilots of two waves each, that differ by user and element."""
    frequencies = 28e9 + 1e6 * np.arange(points)
    delays = DELAY + 1e-9 * np.arange(ELEMENTS)
    turn = np.exp(-2j * np.pi * delays[:, None] * frequencies)
    return mmslam.Measurement.from_arrays(
        frequencies=frequencies,
        positions=5e-3 * np.arange(ELEMENTS),
        uplink={
            name: (1 + index) * turn + 0.3 * np.roll(turn, 1, axis=0)
            for index, name in enumerate(users)
        },
    )


def heard(channel: Any) -> np.ndarray:
    """Sum taps at the subcarriers, as Sionna PHY's ``cir_to_ofdm_channel`` does."""
    turns = channel.tau[..., None].astype(np.float64) * channel.frequencies
    return np.asarray((channel.a * np.exp(-2j * np.pi * turns)).sum(axis=-2))


@pytest.mark.parametrize("points", [64, 65])
@pytest.mark.parametrize(("precision", "within"), [("single", 3e-6), ("double", 1e-12)])
def test_the_taps_sum_to_each_elements_frequency_response(
    points: int, precision: Any, within: float
) -> None:
    pilots = measured(points=points)
    channel = mmslam.to_sionna_cir(pilots, precision=precision)
    assert channel.a.shape == (1, 1, ELEMENTS, 2, 1, points, 1)
    assert channel.tau.shape == (1, 1, ELEMENTS, 2, 1, points)
    summed = heard(channel)
    for user, pilot in enumerate(pilots.uplinks):
        # Rounding of taps and delays in either precision, over a turn of at most 2π·N/2.
        np.testing.assert_allclose(summed[0, 0, :, user, 0], pilot.samples, atol=points * within)
        np.testing.assert_allclose(channel.cfr[0, 0, :, user, 0, 0], pilot.samples, rtol=1e-6)
    assert channel.users == ("ann", "bob")


@pytest.mark.parametrize("points", [64, 65])
def test_subcarriers_are_counted_as_sionna_counts_them(points: int) -> None:
    channel = mmslam.to_sionna_cir(measured(points=points))
    theirs = subcarrier_frequencies(points, 1e6).numpy()
    np.testing.assert_allclose(channel.frequencies, theirs, rtol=1e-6)
    np.testing.assert_allclose(channel.carrier, 28e9 + (points // 2) * 1e6)


def test_a_wave_is_strongest_in_the_tap_of_its_delay() -> None:
    channel = mmslam.to_sionna_cir(measured(points=100, users=("ann",)))
    power = np.abs(channel.a[0, 0, :, 0, 0, :, 0]) ** 2
    at = channel.tau[0, 0, 0, 0, 0, power.argmax(axis=-1)]
    # Taps lie 1/(100 MHz) = 10 ns apart; the delays are 40 to 44 ns.
    np.testing.assert_allclose(at, DELAY, atol=5.1e-9)


def test_a_scenario_becomes_the_channel_of_its_straight_way_without_its_noise() -> None:
    room = parse_scenario(
        {
            "name": "hall",
            "dimensions": 3,
            "radio": {"start_ghz": 28.0, "stop_ghz": 28.1, "points": 11},
            "base_station": {"elements": 4, "spacing_mm": 5.0},
            "users": {"ann": {"position_m": [0.5, 2.0, 0.0]}},
            "noise": {"snr_db": 3.0},
        }
    )
    channel = mmslam.to_sionna_cir([room, room], precision="double")
    length = np.linalg.norm(
        np.array([0.5, 2.0, 0.0]) - room.base_station.element_positions, axis=-1
    )[:, None]
    frequencies = channel.carrier + channel.frequencies
    level = speed_of_light / (4 * np.pi * frequencies * length)
    expected = level * np.exp(-2j * np.pi * frequencies * length / speed_of_light)
    assert channel.cfr.shape == (2, 1, 4, 1, 1, 1, 11)
    for one in channel.cfr[:, 0, :, 0, 0, 0]:
        # 2 m are 200 wavelengths; the carrier is read from a grid in GHz, to 1e-12.
        np.testing.assert_allclose(one, expected, rtol=1e-7)


def test_what_is_no_batch_or_holds_no_pilot_is_refused() -> None:
    echo = mmslam.Measurement.from_arrays(
        frequencies=28e9 + 1e6 * np.arange(4),
        positions=np.arange(2.0),
        echo=np.ones((2, 4), complex),
    )
    with pytest.raises(MeasurementError, match="holds no pilot of a user"):
        mmslam.to_sionna_cir(echo)
    with pytest.raises(
        MeasurementError, match=r"measurement 1 has the users ann, the first one ann"
    ):
        mmslam.to_sionna_cir([measured(), measured(users=("ann",))])
    with pytest.raises(MeasurementError, match=r"64 frequencies .* first one has 5 and 32"):
        mmslam.to_sionna_cir([measured(points=32), measured()])
    with pytest.raises(MeasurementError, match="no measurement is given"):
        mmslam.to_sionna_cir([])
