"""Impairments of a scenario: off by default, each by itself, and what the estimator is told."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.measurement.model import Measurement
from scenes.files.loading import override_scenario
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from simulator.simulation import simulate

FREQUENCIES = np.linspace(220e9, 295e9, 401)
EVERY = {
    "phase_noise_deg": 3.0,
    "phase_noise_samples": 20.0,
    "gain_ripple_db": 0.5,
    "gain_ripple_ghz": 5.0,
    "position_jitter_mm": 0.02,
    "clock_offset_ns": 0.1,
    "dynamic_range_db": 60.0,
}


def scenario(impairments: dict[str, Any] | None = None, **noise: float) -> Scenario:
    return parse_scenario(
        {
            "name": "small",
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 401},
            "base_station": {"elements": 32, "spacing_mm": 0.5},
            "objects": {
                "wall": {
                    "kind": "plate", "material": "metal", "centre_m": [-0.2, 0.4], "length_m": 0.05,
                    "roughness": {"rms_mm": 0.05, "correlation_mm": 0.3},
                }
            },
            "users": {"a": {"position_m": [0.2, 0.3]}, "b": {"position_m": [0.3, 0.3]}},
            "noise": noise,
            **({} if impairments is None else {"impairments": impairments}),
        }
    )  # fmt: skip


def measured(impairments: dict[str, Any] | None = None, **noise: float) -> Measurement:
    return simulate(scenario(impairments, **noise), seed=5).measurement


def arrays(measurement: Measurement) -> list[np.ndarray]:
    assert measurement.echo is not None
    return [measurement.echo.samples, *(uplink.samples for uplink in measurement.uplinks)]


@pytest.fixture(scope="module")
def clean() -> list[np.ndarray]:
    return arrays(measured())


def test_all_impairments_are_off_unless_given(clean: list[np.ndarray]) -> None:
    given = dict.fromkeys(EVERY, 0.0)
    del given["dynamic_range_db"], given["gain_ripple_ghz"]
    for values, same in zip(arrays(measured(given)), clean, strict=True):
        np.testing.assert_array_equal(values, same)


def test_an_impaired_scenario_is_written_and_read_back_equal() -> None:
    scene = scenario({**EVERY, "clock_known": False})
    assert override_scenario(scene, []) == scene


def test_phase_noise_turns_each_array_by_its_own_phases(clean: list[np.ndarray]) -> None:
    turned = arrays(measured({"phase_noise_deg": 3.0}))
    phases = [np.angle(a / b) for a, b in zip(turned, clean, strict=True)]
    for values, same in zip(turned, clean, strict=True):
        np.testing.assert_allclose(np.abs(values), np.abs(same), rtol=1e-12)
    for phase in phases:
        # The rms of n Gaussian values has a standard error of 1/√(2n) of itself.
        rms = np.sqrt(np.mean(phase**2))
        assert rms == pytest.approx(np.radians(3.0), rel=4 / np.sqrt(2 * phase.size))
    correlation = np.mean(phases[1] * phases[2]) / np.radians(3.0) ** 2
    assert abs(correlation) <= 4 / np.sqrt(phases[1].size)


def test_correlated_phase_noise_keeps_its_phase_for_some_samples(clean: list[np.ndarray]) -> None:
    turned = arrays(measured({"phase_noise_deg": 3.0, "phase_noise_samples": 20.0}))
    phase = np.angle(turned[0] / clean[0]).ravel()
    correlation = np.mean(phase[20:] * phase[:-20]) / np.mean(phase**2)
    # Some 13 000 samples hold 640 independent ones.
    assert correlation == pytest.approx(np.exp(-1.0), abs=4 / np.sqrt(phase.size / 20))


def test_the_gain_ripples_alike_in_all_arrays_and_sweeps(clean: list[np.ndarray]) -> None:
    rippled = arrays(measured({"gain_ripple_db": 0.5, "gain_ripple_ghz": 5.0}))
    gains = [a / b for a, b in zip(rippled, clean, strict=True)]
    for gain in gains:
        np.testing.assert_allclose(gain, np.broadcast_to(gains[0][0], gain.shape), rtol=1e-9)
    gain = gains[0][0]
    assert 20 * np.log10(np.abs(gain).max()) == pytest.approx(0.5, abs=1e-3)
    # 15 periods of 5 GHz in 75 GHz: all of the ripple is in one bin.
    spectrum = np.abs(np.fft.fft(gain[:-1]))
    assert set(np.argsort(spectrum)[-2:]) in ({0, 15}, {0, 385})


def test_the_antennas_stand_elsewhere_and_the_estimator_is_not_told() -> None:
    # In free space the pilot's phase says where an element truly stands.
    found = measured({"position_jitter_mm": 0.02})
    nominal = scenario().base_station.element_positions
    assert found.echo is not None
    for reported in (found.echo.positions, found.uplinks[0].positions):
        np.testing.assert_array_equal(reported, nominal)
    user = np.array([0.2, 0.3, 0.0])
    away = np.linalg.norm(user - nominal, axis=-1)
    free = np.exp(-2j * np.pi * FREQUENCIES * away[:, None] / speed_of_light)
    turns = np.angle(np.mean(found.uplinks[0].samples * free.conj(), axis=-1))
    # What the wall adds (-30 dB) averages out over the band; 20 µm are 0.11 rad at 257 GHz.
    moved = turns / (2 * np.pi * 257.5e9 / speed_of_light)
    assert np.std(moved) == pytest.approx(20e-6, rel=4 / np.sqrt(2 * 32))


def test_the_users_clock_shifts_the_uplink_alone(clean: list[np.ndarray]) -> None:
    found = measured({"clock_offset_ns": 0.1})
    shifted = arrays(found)
    np.testing.assert_array_equal(shifted[0], clean[0])
    turn = np.exp(2j * np.pi * FREQUENCIES * 1e-10)
    for values, same in zip(shifted[1:], clean[1:], strict=True):
        np.testing.assert_allclose(values, same * turn, rtol=1e-9)
    assert found.clock_offset == pytest.approx(1e-10)


def test_an_unknown_clock_is_not_told() -> None:
    assert measured({"clock_offset_ns": 0.1, "clock_known": False}).clock_offset is None
    assert measured({"clock_known": False}).clock_offset is None
    assert measured().clock_offset == 0.0


def test_the_dynamic_range_is_limited_last(clean: list[np.ndarray]) -> None:
    for values in arrays(measured({"dynamic_range_db": 40.0}, snr_db=20.0)):
        strongest = np.abs(values).max()
        levels = np.unique(np.concatenate([values.real.ravel(), values.imag.ravel()]))
        # Steps of √6·10^(-40/20) of the strongest before rounding: some hundred levels, equal.
        steps = np.diff(levels)
        np.testing.assert_allclose(steps / steps.min(), np.round(steps / steps.min()), atol=1e-6)
        assert steps.min() == pytest.approx(np.sqrt(6) * 0.01 * strongest, rel=0.03)
    assert len(clean) == 3


def test_one_impairment_redraws_neither_another_nor_the_noise(clean: list[np.ndarray]) -> None:
    noisy = arrays(measured(snr_db=20.0))
    both = arrays(measured({"clock_offset_ns": 0.1}, snr_db=20.0))
    turn = np.exp(2j * np.pi * FREQUENCIES * 1e-10)
    for index in (1, 2):
        noise = noisy[index] - clean[index]
        other = both[index] - clean[index] * turn
        np.testing.assert_allclose(other, noise, atol=1e-9 * np.abs(clean[index]).max())


BAD = [
    ({"phase_noise_deg": -1.0}, r"impairments\.phase_noise_deg = -1\.0: must be greater"),
    ({"phase_noise_samples": 3.0}, r"impairments: phase_noise_samples = 3\.0 has no phase"),
    ({"gain_ripple_db": 0.5}, r"impairments: gain_ripple_db = 0\.5 needs a period; give gain_r"),
    ({"clock_offset_s": 1.0}, r"impairments\.clock_offset_s: unknown key \(did you mean 'clock_o"),
    ({"clock_known": 1}, r"impairments\.clock_known = 1: must be a valid boolean"),
    ({"dynamic_range_db": 0.0}, r"impairments\.dynamic_range_db = 0\.0: must be greater than 0"),
]


@pytest.mark.parametrize(("impairments", "message"), BAD)
def test_an_impairment_that_cannot_be_is_refused(impairments: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        scenario(impairments)


def test_a_noise_floor_is_that_of_temperature_bandwidth_and_noise_figure() -> None:
    floor = {"figure_db": 10.0, "bandwidth_hz": 1e6, "transmit_power_dbm": -30.0}
    clean, noisy = (simulate(scenario(None, **noise), seed=0).measurement for noise in ({}, floor))
    # -174 dBm/Hz (290 K) + 60 dB + 10 dB, over what is sent.
    expected = 10 ** ((-173.975 + 60.0 + 10.0 + 30.0) / 10)
    pairs = [(clean.echo, noisy.echo), *zip(clean.uplinks, noisy.uplinks, strict=True)]
    for without, heard in pairs:
        if without is None or heard is None:
            raise AssertionError("an array is missing")
        power = float(np.mean(np.abs(heard.samples - without.samples) ** 2))
        # Of 12832 exponentials the mean's standard deviation is 0.9 %.
        assert power == pytest.approx(expected, rel=4 / np.sqrt(heard.samples.size))


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        (
            {"figure_db": 8.0},
            r"needs figure_db, bandwidth_hz and transmit_power_dbm; give bandwidth",
        ),
        (
            {"figure_db": 8.0, "bandwidth_hz": 1e6, "transmit_power_dbm": 0.0, "snr_db": 20.0},
            r"snr_db = 20.* exclude each other",
        ),
    ],
)
def test_half_a_noise_floor_or_two_noises_are_refused(
    noise: dict[str, float], message: str
) -> None:
    with pytest.raises(ScenarioError, match=message):
        scenario(None, **noise)
