"""A user and a base station beside a metal wall: two paths, known in closed form."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light

import mmslam
from estimator.measurement.model import MeasurementError
from mmslam.output import OutputError
from scenes.scenario import Scenario, parse_scenario

STATION = np.array([0.0, 0.0, 1.0])
USER = np.array([0.5, 2.0, 1.2])
WALL = 1.0  # x of the wall, which runs along y [m]
POINTS = 17


def scenario(**more: object) -> Scenario:
    return parse_scenario(
        {
            "name": "beside_a_wall",
            "dimensions": 3,
            "max_bounces": 1,
            "radio": {"start_ghz": 5.0, "stop_ghz": 5.4, "points": POINTS},
            "base_station": {
                "elements": [1, 1],
                "spacing_mm": 20.0,
                "position_m": STATION.tolist(),
            },
            "objects": {
                "wall": {
                    "kind": "plate",
                    "material": "metal",
                    "centre_m": [WALL, 1.0, 1.0],
                    "angle_deg": 90.0,
                    "length_m": 3.0,
                    "height_m": 3.0,
                }
            },
            "users": {"ann": {"position_m": USER.tolist()}},
        }
        | more
    )


def lengths() -> np.ndarray:
    image = np.array([2 * WALL - USER[0], *USER[1:]])
    return np.array([np.linalg.norm(place - STATION) for place in (USER, image)])


def closed_form(frequencies: np.ndarray) -> np.ndarray:
    """The field is almost across the plane of incidence, the wall's reflection -1."""
    waves = np.exp(-2j * np.pi * np.outer(lengths(), frequencies) / speed_of_light)
    spread = speed_of_light / frequencies / (4 * np.pi * lengths()[:, None])
    return np.asarray((np.array([1.0, -1.0])[:, None] * waves * spread).sum(axis=0))


def test_the_matrices_hold_the_paths(tmp_path: Path) -> None:
    folder = mmslam.to_deepmimo(scenario(), tmp_path / "wall_5")

    def matrix(name: str) -> np.ndarray:
        return np.asarray(np.load(folder / f"{name}_t000_tx000_r001.npz")[name][0])

    np.testing.assert_allclose(matrix("delay")[:2] * speed_of_light, lengths(), rtol=1e-6)
    level = 20 * np.log10(speed_of_light / 5.2e9 / (4 * np.pi * lengths()))
    np.testing.assert_allclose(matrix("power")[:2], level, atol=0.01)
    assert matrix("inter")[:2].tolist() == [0, 1]
    assert np.isnan(matrix("inter")[2:]).all()
    assert matrix("inter_pos")[1, 0, 0] == pytest.approx(WALL)
    towards = USER - STATION
    assert matrix("aod_az")[0] == pytest.approx(np.degrees(np.arctan2(towards[1], towards[0])))
    cosine = towards[2] / np.linalg.norm(towards)
    assert matrix("aod_el")[0] == pytest.approx(np.degrees(np.arccos(cosine)), rel=1e-6)
    assert matrix("aoa_el")[0] == pytest.approx(np.degrees(np.arccos(-cosine)), rel=1e-6)
    beside = np.load(folder / "uplink.npz")
    assert beside["uplink"].shape == (1, 1, POINTS)
    expected = closed_form(beside["frequency"])
    # The wall's edges scatter by physical optics: a Fresnel zone here is a third of it.
    apart = np.linalg.norm(beside["uplink"][0, 0] - expected) / np.linalg.norm(expected)
    assert apart < 0.1


def test_deepmimo_computes_the_channel_from_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deepmimo = pytest.importorskip("deepmimo", reason="DeepMIMO is no dependency")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deepmimo_scenarios").mkdir()
    made = scenario()
    mmslam.to_deepmimo(made, tmp_path / "deepmimo_scenarios" / "wall_5")
    loaded = deepmimo.load("wall_5")
    step = float(np.diff(made.radio.frequencies)[0])
    count = POINTS // 2 + 1  # DeepMIMO's subcarriers begin at the middle of our band
    parameters = deepmimo.ChannelParameters(
        bs_antenna={"shape": [1, 1]},
        ue_antenna={"shape": [1, 1]},
        ofdm={
            "subcarriers": count,
            "bandwidth": count * step,
            "selected_subcarriers": np.arange(count),
        },
    )
    channel = np.asarray(loaded.compute_channels(parameters))[0, 0, 0] * np.sqrt(count)
    expected = closed_form(made.radio.frequencies[POINTS // 2 :])
    # Its wavelength is that of the middle: 4 % at the end of the band, beside 0.1 dB.
    scale = made.radio.frequencies[POINTS // 2 :] / made.radio.centre_frequency
    assert np.abs(20 * np.log10(np.abs(channel / (expected * scale)))).max() < 0.1
    assert os.listdir("deepmimo_scenarios") == ["wall_5"]


def test_what_deepmimo_could_not_load_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match="0 users"):
        mmslam.to_deepmimo(scenario(users={}), tmp_path / "none")
    with pytest.raises(OutputError, match="small letters"):
        mmslam.to_deepmimo(scenario(), tmp_path / "Wall")
    (tmp_path / "here").mkdir()
    with pytest.raises(OutputError, match="exists; move it away"):
        mmslam.to_deepmimo(scenario(), tmp_path / "here")
