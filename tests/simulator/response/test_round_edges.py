"""Pilots round edges, against Sommerfeld's half plane and Fresnel's screen."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.scenario import Scenario, parse_scenario
from simulator.simulation import simulate
from validation.analytic.half_plane import fresnel_tail, half_plane_over_free_space

FAR = 200.0
"""Of a user whose wave is plane: its front sags by d²/2R = 1 mm over 0.6 m. [m]"""


def scene(material: str, elements: int, user: list[float], **more: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "made",
            "max_bounces": 0,
            "waves": "cylindrical",
            "radio": {"start_ghz": 27.5, "stop_ghz": 28.5, "points": 3},
            "base_station": {"elements": elements, "spacing_mm": 10.0},
            # Its end is at (0, 0.5), the other one so far that nothing comes round it.
            "objects": {
                "plate": {"kind": "plate", "material": material, "centre_m": [-40.0, 0.5],
                          "length_m": 80.0}
            },
            "users": {"user": {"position_m": user}},
            "effects": {"diffraction": True},
            **more,
        }
    )  # fmt: skip


def over_free_space(one: Scenario) -> np.ndarray:
    alone = one.model_copy(update={"objects": {}})
    both = [simulate(each, seed=0).measurement.uplinks[0].samples for each in (one, alone)]
    return np.asarray(both[0] / both[1])


@pytest.mark.parametrize("polarization", ["vertical", "horizontal"])
def test_behind_a_conducting_half_plane_the_field_is_sommerfelds(polarization: str) -> None:
    radio = {"start_ghz": 27.5, "stop_ghz": 28.5, "points": 3, "polarization": polarization}
    one = scene("metal", 41, [0.3 * FAR, FAR], radio=radio)
    ratio = over_free_space(one)
    places = one.base_station.element_positions[:, :2] - [0.0, 0.5]
    # Angles from the plate through the air above it; the plate leads to -x.
    source = np.arctan2(FAR - 0.5, 0.3 * FAR)
    incident = np.pi - source
    outgoing = np.pi + np.arctan2(-places[:, 1], places[:, 0])
    phase = np.hypot(*places.T)[:, None] * 2 * np.pi * one.radio.frequencies / speed_of_light
    expected = half_plane_over_free_space(
        float(incident), outgoing, phase, reflection=-1.0 if polarization == "vertical" else 1.0
    )
    # The wave from 200 m is not plane: the distance parameter differs by 0.6/200.
    assert np.abs(np.abs(ratio) - np.abs(expected)).max() <= 0.01


@pytest.mark.parametrize(("material", "limit"), [("metal", 0.3), ("absorber", 0.1)])
def test_on_the_shadow_boundary_half_the_field_arrives(material: str, limit: float) -> None:
    levels = []
    for shift in (-1e-4, 1e-4):
        one = scene(material, 1, [2 * shift, 1.0])
        levels.append(20 * np.log10(np.abs(over_free_space(one)[0])))
    # 0.1 mm off at the edge: v = 0.03, 0.2 dB to either side; the mean is on the boundary. What a
    # conductor reflects adds 1/√(8πkL) = 1.6 % of the field to the half, L = 0.25 m.
    assert np.mean(levels) == pytest.approx(-6.02, abs=limit)
    assert abs(levels[0] - levels[1]).max() <= 0.5  # no jump


def test_behind_an_absorbing_screen_the_field_is_fresnels() -> None:
    one = scene("absorber", 21, [0.0, 1.5])
    ratio = np.abs(over_free_space(one)[:, 1])
    across = one.base_station.element_positions[:, 0]
    wavelength = speed_of_light / 28e9
    # The straight way crosses the screen's plane at 2/3 of the array's offset.
    v = -across * (1.0 / 1.5) * np.sqrt(2 / wavelength * (1 / 0.5 + 1 / 1.0))
    expected = np.abs(fresnel_tail(np.sqrt(np.pi / 2) * v))
    # Up to 10 cm off: the detour is that of Fresnel's parabola within 2 %.
    assert np.abs(20 * np.log10(ratio / expected)).max() <= 0.5
