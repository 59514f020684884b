"""A scene far from the origin gives the samples of the same scene at the origin."""

from typing import Any

import numpy as np
import pytest

from estimator.measurement.model import Measurement
from scenes.scenario import parse_scenario
from simulator.scene.scenario_paths import scenario_paths
from simulator.simulation import simulate

FAR = (300.0, 500.0)

WITHIN_DB = 0.01
"""Largest change of any sample. Double precision places what is 600 m away within 0.1 pm, 1e-9 of
a phase at 300 GHz; what is left is a ray that grazes a facet by the last bit. [dB]"""


def room(by: tuple[float, float], *, bounces: int) -> dict[str, Any]:
    """Two rough walls that form a corner, a post, a screen, a user."""

    def at(x: float, y: float) -> list[float]:
        return [x + by[0], y + by[1]]

    rough = {"rms_mm": 0.05, "correlation_mm": 1.0}
    wall = {"kind": "plate", "material": "metal", "length_m": 0.12, "roughness": rough}
    return {
        "name": "moved",
        "max_bounces": bounces,
        "radio": {"start_ghz": 140.0, "stop_ghz": 150.0, "points": 5},
        "base_station": {"elements": 3, "spacing_mm": 1.0, "position_m": at(0.0, 0.0)},
        "objects": {
            "one": {**wall, "centre_m": at(0.05, 0.40), "angle_deg": 135.0},
            "two": {**wall, "centre_m": at(-0.06, 0.40), "angle_deg": 45.0},
            "post": {
                "kind": "cylinder", "material": "metal",
                "centre_m": at(0.10, 0.25), "radius_m": 0.006,
            },
            "screen": {
                "kind": "plate", "material": "absorber",
                "centre_m": at(0.05, 0.1), "angle_deg": 90.0, "length_m": 0.1,
            },
        },
        "users": {"user": {"position_m": at(-0.09, 0.1)}},
    }  # fmt: skip


def room_in_space(by: tuple[float, float], *, bounces: int) -> dict[str, Any]:
    """A box before a wall, and a user."""

    def at(x: float, y: float, z: float) -> list[float]:
        return [x + by[0], y + by[1], z]

    return {
        "name": "moved",
        "dimensions": 3,
        "max_bounces": bounces,
        "radio": {"start_ghz": 57.0, "stop_ghz": 60.0, "points": 5},
        "base_station": {"elements": [2, 2], "spacing_mm": 2.5, "position_m": at(0, 0, 0)},
        "objects": {
            "wall": {
                "kind": "plate", "material": "metal", "centre_m": at(0.0, 0.6, 0.0),
                "angle_deg": 45.0, "length_m": 0.3, "height_m": 0.3,
            },
            "box": {
                "kind": "box", "material": "metal", "centre_m": at(0.4, 0.55, 0.0),
                "length_m": 0.06, "depth_m": 0.06, "height_m": 0.06,
            },
        },
        "users": {"user": {"position_m": at(0.5, 0.62, 0.0)}},
    }  # fmt: skip


def signals(measurement: Measurement) -> dict[str, np.ndarray]:
    assert measurement.echo is not None
    found = {"echo": np.asarray(measurement.echo.samples)}
    return found | {one.user: np.asarray(one.samples) for one in measurement.uplinks}


@pytest.mark.parametrize("bounces", [1, 2])
@pytest.mark.parametrize("make", [room, room_in_space])
def test_moving_a_scene_changes_no_sample(make: Any, bounces: int) -> None:
    here, there = (
        signals(simulate(parse_scenario(make(by, bounces=bounces)), seed=3).measurement)
        for by in ((0.0, 0.0), FAR)
    )
    assert set(here) == set(there) == {"echo", "user"}
    for name, samples in here.items():
        assert np.all(samples != 0)
        error = np.abs(there[name] / samples - 1)
        assert 20 * np.log10(1 + error.max()) <= WITHIN_DB, name


def test_moving_a_scene_moves_its_paths() -> None:
    here, there = (scenario_paths(parse_scenario(room(by, bounces=3))) for by in ((0.0, 0.0), FAR))
    assert [(one.end, one.bounces) for one in here] == [(one.end, one.bounces) for one in there]
    for one, other in zip(here, there, strict=True):
        np.testing.assert_allclose(other.vertices - [*FAR, 0.0], one.vertices, atol=1e-9)
