"""``max_bounces`` from 0 to 8 in a corridor of two metal walls, against all its images."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.scenario import Scenario, ScenarioError, parse_scenario
from simulator.multibounce import chain_count
from simulator.scene import scene_mirrors
from simulator.scene.scenario_paths import scenario_paths
from simulator.simulation import Simulation, simulate
from simulator.specular import image_sources

HALF_WIDTH = 0.25
USER = (0.04, 2.0)
RANGE = range(9)
WAVELENGTH = speed_of_light / 8e9


WALL = {"kind": "plate", "material": "metal", "angle_deg": 90.0, "length_m": 3.1}
WALLS: dict[str, Any] = {
    "left": {**WALL, "centre_m": [-HALF_WIDTH, 0.75]},
    "right": {**WALL, "centre_m": [HALF_WIDTH, 0.75]},
}


def corridor(bounces: int, **tables: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "corridor",
            "max_bounces": bounces,
            "radio": {"start_ghz": 8.0, "stop_ghz": 8.2, "points": 2},
            "base_station": {"elements": 2, "spacing_mm": 17.0},
            "objects": WALLS,
            "users": {"user": {"position_m": list(USER)}},
            **tables,
        }
    )


@cache
def corridor_up_to(bounces: int) -> Simulation:
    return simulate(corridor(bounces), seed=0)


def uplink(bounces: int) -> np.ndarray:
    (pilot,) = corridor_up_to(bounces).measurement.uplinks
    return np.asarray(pilot.samples)


def echo(bounces: int) -> np.ndarray:
    found = corridor_up_to(bounces).measurement.echo
    scene = corridor(bounces)
    shape = (scene.base_station.element_count, scene.radio.points)
    return np.zeros(shape, np.complex128) if found is None else np.asarray(found.samples)


def image_lengths(source: np.ndarray, bounces: int) -> list[np.ndarray]:
    """Ways to both elements from the images that so many mirrorings, left and right, make."""
    elements = corridor(bounces).base_station.element_positions
    lengths = []
    for first in (-1.0, 1.0) if bounces else (1.0,):
        image = source.copy()
        for turn in range(bounces):
            plane = first * (-1) ** turn * HALF_WIDTH
            image[..., 0] = 2 * plane - image[..., 0]
        lengths.append(np.linalg.norm(elements - image, axis=-1))
    return lengths


def images(source: np.ndarray, bounces: int) -> np.ndarray:
    """The field of all images of so many bounces at both elements: conductors turn it round."""
    wavelengths = speed_of_light / corridor(0).radio.frequencies
    total = 0.0
    for length in image_lengths(source, bounces):
        turns = length[:, None] / wavelengths
        total = total + (-1) ** bounces * np.exp(-2j * np.pi * turns) / (4 * np.pi * turns)
    return np.asarray(total)


ERROR = speed_of_light / (2 * np.pi * 8e9 * HALF_WIDTH)
"""What each bounce errs by, over the images' strength: 1/(k r) at the nearest wall, which is what
stationary phase leaves out, 2.4 %; ends of the walls 0.3 m and more off the outermost reflections
send back λ/(2π · 0.3 m), 2 %. [-]"""


def check(added: np.ndarray, source: np.ndarray, orders: range) -> None:
    expected = np.sum([images(source, order) for order in orders], axis=0)
    strength = sum(
        float(np.mean(WAVELENGTH / (4 * np.pi * length)))
        for order in orders
        for length in image_lengths(source, order)
    )
    # Complex: 0.1 of it is 0.8 dB of level, or 0.1 rad of phase, 0.6 mm of length.
    assert np.abs(added - expected).max() <= ERROR * orders[-1] * strength


ORDERS = [range(1, 2), range(2, 3), range(3, 4)]
HIGH = [range(4, 9), *(range(n, n + 1) for n in RANGE[4:])]
EACH = [pytest.param(orders, marks=pytest.mark.slow) for orders in HIGH]
"""Up to eight bounces a minute; what each adds is one more turn of the same loop."""


@pytest.mark.parametrize("orders", [*ORDERS, *EACH])
def test_each_bounce_adds_its_two_images_to_the_pilot(orders: range) -> None:
    added = uplink(orders[-1]) - uplink(orders[0] - 1)
    check(added, np.array([*USER, 0.0]), orders)


def test_without_bounces_the_pilot_is_the_line_of_sight_and_nothing_returns() -> None:
    expected = images(np.array([*USER, 0.0]), 0)
    np.testing.assert_allclose(uplink(0), expected, rtol=1e-9)  # double precision
    assert corridor_up_to(0).measurement.echo is None


@pytest.mark.parametrize("orders", [*ORDERS, *EACH])
def test_each_bounce_adds_its_two_images_to_the_echo(orders: range) -> None:
    added = echo(orders[-1]) - echo(orders[0] - 1)
    check(added, corridor(0).base_station.element_positions, orders)


@pytest.mark.parametrize("bounces", [0, 1, 2, 3, 8])
def test_the_paths_are_the_images(bounces: int) -> None:
    found = [path for path in scenario_paths(corridor(bounces)) if path.kind == "user"]
    assert [path.bounces for path in found] == [0] + [
        n for n in range(1, bounces + 1) for _ in "ab"
    ]
    station = corridor(bounces).base_station
    for path in found:
        elements = image_lengths(np.array([*USER, 0.0]), path.bounces)
        near = [np.abs(length - path.length).min() for length in elements]
        # From the middle of the array: half the spacing times the sine of 65° off.
        assert min(near) <= np.linalg.norm(station.element_positions[0])


POST = {"kind": "cylinder", "material": "metal", "centre_m": [0.1, 1.0], "radius_m": 0.01}


@pytest.mark.parametrize(("bounces", "mirrors"), [(0, []), (1, [0]), (2, [0, 1, 1])])
def test_a_body_in_the_paths_is_a_bounce_of_the_echo(bounces: int, mirrors: list[int]) -> None:
    scene = corridor(bounces, objects={**WALLS, "post": POST})
    found = [path.bounces for path in scenario_paths(scene) if path.kind == "object"]
    assert found == mirrors


def test_points_are_no_surfaces_and_return_without_a_bounce() -> None:
    points = {"point": {"position_m": [0.1, 1.0], "rcs_m2": 1e-3}}
    changes: tuple[dict[str, Any], ...] = ({}, {"objects": {}})
    one, none = (
        simulate(corridor(0, points=points, **more), seed=0).measurement.echo for more in changes
    )
    assert one is not None
    assert none is not None
    np.testing.assert_array_equal(one.samples, none.samples)


def test_more_chains_than_can_be_summed_are_refused_with_what_is_possible(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(chain_count, "MOST_LINKS", 3e6)
    with pytest.raises(
        ScenarioError,
        match=r"max_bounces = 8: .* links .* more than 3e\+06; set max_bounces = \d, ",
    ):
        simulate(corridor(8), seed=0)


def test_more_ways_over_mirrors_in_space_than_can_be_traced_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(image_sources, "MOST_LEGS", 5)
    monkeypatch.setattr(scene_mirrors, "MOST_LAUNCHED", 2)
    wall = {"kind": "plate", "material": "metal", "angle_deg": 90.0, "length_m": 0.2,
            "height_m": 0.2}  # fmt: skip
    scene = parse_scenario(
        {
            "name": "corridor",
            "dimensions": 3,
            "max_bounces": 8,
            "radio": {"start_ghz": 20.0, "stop_ghz": 20.4, "points": 3},
            "base_station": {"elements": 2, "spacing_mm": 7.0},
            "objects": {
                "left": {**wall, "centre_m": [-0.1, 0.2, 0.0]},
                "right": {**wall, "centre_m": [0.1, 0.2, 0.0]},
            },
            "users": {"user": {"position_m": [0.04, 0.3, 0.0]}},
        }
    )
    # Two ways with each number of mirrors: rays meet those of one and of two at least.
    with pytest.raises(ScenarioError, match=r"max_bounces = 8: .* 2 ways .* set max_bounces = 7"):
        simulate(scene, seed=0)
