"""Pilots round edges in space, against Kirchhoff's integral and Sommerfeld's half plane."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from scenes.scenario import Scenario, parse_scenario
from simulator.simulation import simulate
from simulator.specular.rim_diffraction import rim_factor
from validation.analytic.half_plane import half_plane_over_free_space

FAR = 200.0
"""Distance of a user whose wave is plane. [m]"""


def scene(body: dict[str, Any], user: list[float], elements: int, **more: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "made",
            "dimensions": 3,
            "max_bounces": 0,
            "radio": {"start_ghz": 27.5, "stop_ghz": 28.5, "points": 3},
            "base_station": {"elements": [elements, 1], "spacing_mm": 10.0},
            "objects": {"body": body},
            "users": {"user": {"position_m": user}},
            "effects": {"diffraction": True},
            **more,
        }
    )


def over_free_space(one: Scenario) -> np.ndarray:
    alone = one.model_copy(update={"objects": {}})
    both = [simulate(each, seed=0).measurement.uplinks[0].samples for each in (one, alone)]
    return np.asarray(both[0] / both[1])


def plate(material: str, length: float, height: float, centre: list[float]) -> dict[str, Any]:
    return {
        "kind": "plate",
        "material": material,
        "length_m": length,
        "height_m": height,
        "centre_m": centre,
    }


def corners(body: dict[str, Any]) -> Float[np.ndarray, "4 3"]:
    across, up = body["length_m"] / 2, body["height_m"] / 2
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    turned = np.stack([signs[:, 0] * across, np.zeros(4), signs[:, 1] * up], axis=-1)
    return np.asarray(np.array(body["centre_m"]) + turned)


@pytest.mark.parametrize(
    ("body", "user"),
    [
        (plate("absorber", 4.0, 4.0, [-2.0, 0.5, 0.0]), [0.003, 1.5, 0.0]),  # one edge
        (plate("absorber", 0.6, 0.5, [-0.2, 0.5, 0.05]), [0.053, 1.5, 0.1]),
        (plate("absorber", 0.3, 0.3, [0.0, 0.5, 0.0]), [0.002, 2.0, 0.0]),
        (plate("absorber", 0.6, 0.6, [-0.3, 0.5, 0.25]), [0.004, 1.5, 0.6]),  # oblique
    ],
)
def test_behind_an_absorbing_screen_the_field_is_kirchhoffs(
    body: dict[str, Any], user: list[float]
) -> None:
    one = scene(body, user, 41)
    elements = one.base_station.element_positions
    count = len(elements)
    blocked = rim_factor(
        np.tile(np.array(user), (count, 1)),
        elements,
        np.tile(corners(body), (count, 1, 1)),
        one.radio.frequencies,
    )
    # The obliquity differs from Kirchhoff's, and edges are summed for small angles between them.
    assert np.abs(over_free_space(one) - (1 - blocked)).max() <= 0.03


@pytest.mark.parametrize("rise", [0.0, 0.5])
def test_behind_a_conducting_half_plane_the_field_is_sommerfelds(rise: float) -> None:
    body = plate("metal", 80.0, 400.0, [-40.0, 0.5, 0.0])
    one = scene(body, [0.3 * FAR, FAR, rise * FAR], 41)
    ratio = over_free_space(one)
    places = one.base_station.element_positions[:, :2] - [0.0, 0.5]
    incident = np.pi - np.arctan2(FAR - 0.5, 0.3 * FAR)
    outgoing = np.pi + np.arctan2(-places[:, 1], places[:, 0])
    # A wave that is oblique to the edge: the plane problem with k sin(β).
    sine = np.hypot(0.3, 1.0) / np.hypot(np.hypot(0.3, 1.0), rise)
    phase = np.hypot(*places.T)[:, None] * 2 * np.pi * sine / speed_of_light
    expected = half_plane_over_free_space(
        float(incident), outgoing, phase * one.radio.frequencies, reflection=-1.0
    )
    # The wave from 200 m is not plane: the distance parameter differs by 0.6/200.
    assert np.abs(np.abs(ratio) - np.abs(expected)).max() <= 0.01


@pytest.mark.parametrize(("kind", "depth"), [("plate", 0.0), ("box", 0.2)])
def test_levels_do_not_jump_at_a_shadow_boundary_nor_beside_a_plates_corner(
    kind: str, depth: float
) -> None:
    body = plate("metal", 0.6, 0.6, [-0.35, 0.5, 0.0])
    if kind == "box":
        body |= {"kind": "box", "depth_m": depth}
    # The ray from the array past the upright edge farther away.
    boundary = -0.05 * 1.5 / (0.5 + depth / 2)
    ways = [(0, boundary)]
    if kind == "plate":  # beside the corners of boxes levels may jump
        ways.append((2, 0.3 * 1.5 / 0.5))
    for axis, middle in ways:
        levels = []
        for place in middle + 0.0013 + np.linspace(-0.02, 0.02, 9):
            user = [boundary + 0.05, 1.5, 0.02]
            user[axis] = float(place)
            levels.append(20 * np.log10(np.abs(over_free_space(scene(body, user, 1))[0, 1])))
        # Steps of 5 mm: Fresnel's v changes by 0.05, half a decibel. A conductor's corner is no
        # product of its edges, as a screen's is: up to a decibel is left there.
        assert np.abs(np.diff(levels)).max() <= 1.5
