"""What antenna patterns leave out, against the full sum; and what shafts see, against rays."""

from typing import Any

import numpy as np
import pytest

from scenes.scenario import Scenario, parse_scenario
from scenes.schema.antenna import Isotropic
from simulator.antennas.beam_culling import LEVEL, in_reach
from simulator.antennas.ports import Ports
from simulator.geometry.ray_scene import facets_visible
from simulator.response.single_bounce_3d import scattered_in_space, sightlines
from simulator.scattering.physical_optics import scattered
from simulator.scene.array_antennas import array_group, user_group
from simulator.scene.radio_scene import RadioScene, radio_scene


def room(*, gain_dbi: float = 20.0, objects: dict[str, Any] | None = None) -> Scenario:
    """A rough wall of 1 m² before an array of horns, and what else there is."""
    wall = {
        "kind": "plate", "material": "metal", "centre_m": [0.0, 0.7, 0.0], "angle_deg": 20.0,
        "length_m": 1.0, "height_m": 1.0,
        "roughness": {"rms_mm": 0.4, "correlation_mm": 16.0},
    }  # fmt: skip
    return parse_scenario(
        {
            "name": "room", "dimensions": 3, "max_bounces": 1,
            "radio": {"start_ghz": 14.0, "stop_ghz": 16.0, "points": 11},
            "base_station": {
                "elements": [4, 3], "spacing_mm": 16.0,
                "antenna": {"kind": "horn", "gain_dbi": gain_dbi},
            },
            "objects": {"wall": wall} | (objects or {}),
            "users": {
                "far": {
                    "position_m": [0.5, 0.2, 0.1],
                    "antenna": {"kind": "horn", "gain_dbi": 20.0, "aim_m": [0.0, 0.7, 0.0]},
                }
            },
        }
    )  # fmt: skip


def whole(scenario: Scenario) -> RadioScene:
    """The same scene with facets all over."""
    blind = scenario.model_copy(
        update={
            "base_station": scenario.base_station.model_copy(update={"antenna": Isotropic()}),
            "users": {},
        }
    )
    made = radio_scene(blind, seed=1, sample=0)
    return RadioScene(
        scenario=scenario, rays=made.rays, facets=made.facets, elements=made.elements,
        scattering=made.scattering, mirrors=made.mirrors,
    )  # fmt: skip


@pytest.mark.parametrize("over", ["echo", "uplink"])
def test_what_patterns_leave_out_is_below_its_bound(over: str) -> None:
    scenario = room()
    made, every = radio_scene(scenario, seed=1, sample=0), whole(scenario)
    assert made.facets is not None
    assert every.facets is not None
    assert made.facets.count < 0.8 * every.facets.count
    array = array_group(scenario, made.elements)
    send = array if over == "echo" else user_group(scenario, "far")
    found = scattered_in_space(made, send, array)
    facets = every.facets
    seen = np.ones((len(array.positions), facets.count), dtype=bool)
    receive = Ports(positions=array.positions, pattern=array.pattern, visible=seen)
    transmit = receive
    if send is not array:
        transmit = Ports(positions=send.positions, pattern=send.pattern, visible=seen[:1])
    full = scattered(facets, transmit, receive, scenario.radio.frequencies, waves="spherical")
    # All that is left out, in phase, at LEVEL of both peaks: the bound of
    # simulator.antennas.beam_culling.
    left_out = ~in_reach([(send, array)], facets.centres, 0.0)
    here, there = (
        np.linalg.norm(facets.centres - sight.centre, axis=-1) for sight in (send, array)
    )
    peaks = send.pattern.peak * array.pattern.peak
    bound = LEVEL * peaks * np.sum((2 * facets.sizes / (8 * np.pi * here * there))[left_out])
    largest = float(np.abs(found - full).max())
    assert largest <= bound + 2e-4 * float(np.abs(full).max())
    assert np.linalg.norm(found - full) <= 2e-3 * np.linalg.norm(full)


def test_the_wall_is_the_same_wherever_antennas_look() -> None:
    scenario = room()
    made, every = radio_scene(scenario, seed=1, sample=0).facets, whole(scenario).facets
    assert made is not None
    assert every is not None
    known = {tuple(centre) for centre in np.round(every.centres, 9)}
    assert all(tuple(centre) in known for centre in np.round(made.centres[::97], 9))


def test_shafts_see_what_rays_see() -> None:
    post = {
        "kind": "box", "material": "metal", "centre_m": [0.12, 0.4, 0.05], "angle_deg": 30.0,
        "length_m": 0.06, "depth_m": 0.04, "height_m": 0.2,
    }  # fmt: skip
    ball = {
        "kind": "cylinder", "material": "wood", "centre_m": [-0.15, 0.35, -0.1],
        "radius_m": 0.03, "height_m": 0.1,
    }  # fmt: skip
    scenario = room(gain_dbi=8.0, objects={"post": post, "ball": ball})
    scene = radio_scene(scenario, seed=1, sample=0)
    facets = scene.facets
    assert facets is not None
    array, user = array_group(scenario, scene.elements), user_group(scenario, "far")
    some = np.arange(0, facets.count, 3)
    look = sightlines(scene, user, array)
    seen = look(some)
    assert 0 < look.traced < some.size  # for some there was no need of a ray
    rays = facets_visible(scene.rays, facets.part(some), array.positions)
    rays &= facets_visible(scene.rays, facets.part(some), user.positions)
    found = np.repeat(seen.always[None], len(rays), axis=0)
    found[:, seen.sometimes] = seen.table.T

    # A ray from a facet that faces away runs through its own body, where that is solid.
    def facing(places: np.ndarray) -> Any:
        towards = places[:, None] - facets.centres[some]
        return np.einsum("pfx,fx->pf", towards, facets.normals[some]) > 0

    both = facing(array.positions) & facing(user.positions)
    both |= facets.two_sided[some]
    np.testing.assert_array_equal(found & both, rays & both)
    assert np.any(rays & both)
    assert np.any(~rays & both)
