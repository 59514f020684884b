"""Echoes and pilots in space over several surfaces: images, physical optics twice, reciprocity."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from jaxtyping import Int
from scipy.constants import speed_of_light

from scenes.scenario import Scenario, parse_scenario
from simulator.antennas.antenna_pattern import ISOTROPIC
from simulator.antennas.beam_culling import AntennaGroup
from simulator.antennas.links import Links
from simulator.materials.fresnel_slab import Conductor
from simulator.multibounce.multibounce_3d import coherent_echo, echo_over_mirrors
from simulator.response.uplink import simulate_uplink
from simulator.scattering.patch_sum import scattered_by_patches
from simulator.scene.array_antennas import array_group
from simulator.scene.radio_scene import RadioScene, radio_scene
from simulator.specular.path_field import roughness_loss
from simulator.visibility.seen import Seen

ACCURACY = 1e-3
"""Of sums over images, relative: those of patches (2e-4), a patch's reflection taken at its
centre, and its facets summed in other patches. [-]"""


def scene(
    *, wall: Any = None, hidden: bool = True, rms_mm: float = 0.0, more: Any = None, **station: Any
) -> tuple[Scenario, RadioScene]:
    """A can behind a screen, seen over a wall at 45° only; the wall's image of it is ahead."""
    objects: dict[str, Any] = {
        "wall": {
            "kind": "plate", "material": "metal" if wall is None else wall,
            "centre_m": [0.0, 0.8, 0.0], "angle_deg": 45.0, "length_m": 0.6, "height_m": 0.4,
            "roughness": {"rms_mm": rms_mm, "correlation_mm": 5.0},
        },
        "can": {
            "kind": "cylinder", "material": "metal", "centre_m": [0.6, 0.8, 0.0],
            "radius_m": 0.02, "height_m": 0.03,
        },
        **(more or {}),
    }  # fmt: skip
    if hidden:
        objects["screen"] = {
            "kind": "plate", "material": "absorber", "centre_m": [0.25, 0.4, 0.0],
            "angle_deg": 100.0, "length_m": 0.6, "height_m": 0.5,
        }  # fmt: skip
    scenario = parse_scenario(
        {
            "name": "ghost", "dimensions": 3, "max_bounces": 3,
            "radio": {"start_ghz": 28.0, "stop_ghz": 32.0, "points": 21},
            "base_station": {
                "elements": [2, 2], "spacing_mm": 8.0,
                "antenna": {"kind": "horn", "gain_dbi": 15.0},
            } | station,
            "objects": objects,
            "users": {"user": {"position_m": [1.0, 1.2, 0.0]}},
        }
    )  # fmt: skip
    return scenario, radio_scene(scenario, seed=0, sample=0)


def everything(count: int, some: Int[np.ndarray, " some"]) -> Seen:
    return Seen(
        always=np.ones(len(some), dtype=bool),
        sometimes=np.empty(0, dtype=np.int64),
        table=np.empty((0, count), dtype=bool),
    )


def mirrored(points: np.ndarray) -> np.ndarray:
    """In the wall's plane y = x + 0.8."""
    return np.stack([points[:, 1] - 0.8, points[:, 0] + 0.8, points[:, 2]], axis=-1)


def in_plain_sight(scenario: Scenario, made: RadioScene) -> np.ndarray:
    """The can's echo as heard where the array's image stands, nothing in the way."""
    array = array_group(scenario, made.elements)
    places = mirrored(array.positions)
    aim = mirrored(array.positions[:1] + array.pattern.aim)[0] - places[0]
    pattern = type(array.pattern)(array.pattern.antenna, aim)
    links = Links(senders=places, receivers=places, sent=pattern, received=pattern)
    look = partial(everything, len(places))
    frequencies = scenario.radio.frequencies
    return np.asarray(scattered_by_patches(made.facets_of("can"), links, look, frequencies))


def error(found: np.ndarray, exact: np.ndarray) -> float:
    assert np.linalg.norm(exact) > 0
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def test_a_target_hidden_behind_a_screen_echoes_as_its_image_does() -> None:
    scenario, made = scene()
    array = array_group(scenario, made.elements)
    ghost = echo_over_mirrors(made, array, array)
    assert error(ghost, in_plain_sight(scenario, made)) <= ACCURACY


def test_a_rough_mirror_loses_its_coherent_part_once_each_way() -> None:
    scenario, made = scene(rms_mm=0.6)
    array = array_group(scenario, made.elements)
    ghost = coherent_echo(made, array, array)
    wavenumbers = 2 * np.pi * scenario.radio.frequencies / speed_of_light
    loss = roughness_loss(wavenumbers * 0.6e-3 * np.cos(np.pi / 4))
    # The can's 4 cm seen from 1.4 m: angles of incidence within 2° of 45°, 2 (k rms)² sin 90° 2°.
    assert error(ghost, loss**2 * in_plain_sight(scenario, made)) <= 0.02


def test_without_the_screen_both_mixed_ways_are_added() -> None:
    """Wall-target and target-wall are one by reciprocity, beside wall-target-wall."""
    wide: Any = {"antenna": {"kind": "isotropic"}}
    scenario, made = scene(hidden=False, **wide)
    array = array_group(scenario, made.elements)
    ghost = echo_over_mirrors(made, array, array)
    only = in_plain_sight(scenario, made)
    places = mirrored(array.positions)
    mixed = Links(senders=array.positions, receivers=places, sent=ISOTROPIC, received=ISOTROPIC)
    can, look = made.facets_of("can"), partial(everything, len(places))
    over_one = scattered_by_patches(can, mixed, look, scenario.radio.frequencies)
    assert error(ghost, only - 2 * over_one) <= ACCURACY  # a conductor turns the field round once


@pytest.mark.parametrize("material", ["metal", {"name": "plasterboard", "thickness_mm": 9.5}])
def test_transmitter_and_receiver_may_change_places(material: Any) -> None:
    scenario, made = scene(wall=material)
    here = array_group(scenario, made.elements)
    there = AntennaGroup(
        positions=here.positions + np.array([0.03, 0.0, 0.01]), pattern=here.pattern
    )
    one = echo_over_mirrors(made, here, there)
    other = echo_over_mirrors(made, there, here)
    assert error(one, other) <= ACCURACY


def test_a_corner_of_two_walls_returns_the_antennas_image() -> None:
    """Two walls at right angles turn round what comes in: λ/4πL over twice the way to the edge."""
    second = {
        "kind": "plate",
        "material": "metal",
        "centre_m": [0.15, 0.95, 0.0],
        "angle_deg": 135.0,
        "length_m": 0.3 * 2**0.5,
        "height_m": 0.4,
    }
    first = {**second, "centre_m": [-0.15, 0.95, 0.0], "angle_deg": 45.0}
    scenario = parse_scenario(
        {
            "name": "corner", "dimensions": 3, "max_bounces": 2,
            "radio": {"start_ghz": 28.0, "stop_ghz": 32.0, "points": 21},
            "base_station": {"elements": [2, 2], "spacing_mm": 8.0},
            "objects": {"left": first, "right": second},
        }
    )  # fmt: skip
    made = radio_scene(scenario, seed=0, sample=0)
    array = array_group(scenario, made.elements)
    found = echo_over_mirrors(made, array, array)
    edge = np.array([0.0, 1.1])
    lengths = 2 * np.linalg.norm(array.positions[:, :2] - edge, axis=-1)
    wavelengths = speed_of_light / scenario.radio.frequencies
    one_way = wavelengths / (4 * np.pi * lengths[:, None])
    expected = one_way * np.exp(-2j * np.pi * lengths[:, None] / wavelengths)
    # Left first and right first, each by half; two reflections of a conductor cancel in sign.
    # Of the faces' far edges, each v = 3.8 Fresnel widths off: 1/(√2 π v), 6 % of the field.
    assert error(found, expected) <= 0.15


def test_a_pilot_over_two_mirrors_travels_as_from_the_image_of_the_image() -> None:
    aside = {
        "kind": "plate", "material": "metal", "centre_m": [1.0, 0.8, 0.0], "angle_deg": 45.0,
        "length_m": 0.4, "height_m": 0.4,
    }  # fmt: skip
    out_of_the_way = {
        "kind": "cylinder",
        "material": "metal",
        "centre_m": [0.7, 0.3, 0.0],
        "radius_m": 0.02,
        "height_m": 0.03,
    }
    wide: Any = {"antenna": {"kind": "isotropic"}}
    scenario, made = scene(more={"aside": aside, "can": out_of_the_way}, **wide)
    user = scenario.users["user"]
    with_two = simulate_uplink(made, user, None, advance=lambda: None)
    fewer = scenario.model_copy(update={"max_bounces": 1})
    same = RadioScene(
        scenario=fewer, rays=made.rays, facets=made.facets, elements=made.elements,
        scattering=made.scattering, mirrors=made.mirrors,
    )  # fmt: skip
    over_two = with_two - simulate_uplink(same, user, None, advance=lambda: None)
    image = mirrored(np.array([[1.2 + 0.2, 1.0 - 0.2, 0.0]]))  # in the plane y = x - 0.2 first
    lengths = np.linalg.norm(made.elements - image, axis=-1)[:, None]
    wavelengths = speed_of_light / scenario.radio.frequencies
    expected = wavelengths / (4 * np.pi * lengths) * np.exp(-2j * np.pi * lengths / wavelengths)
    # Of the edges of the smaller mirror, some 4 Fresnel widths off: 6 % of the field each.
    assert error(over_two, expected) <= 0.2


@pytest.mark.slow
def test_a_ghost_over_a_wall_is_that_of_physical_optics_twice() -> None:
    """One-way waves over the wall's facets at each facet of the can, linked by reciprocity."""
    scenario, made = scene(antenna={"kind": "isotropic"})
    array = array_group(scenario, made.elements)
    found = echo_over_mirrors(made, array, array)[0]
    source, wall, can = array.positions[0], made.facets_of("wall"), made.facets_of("can")
    assert isinstance(wall.materials[0], Conductor)
    towards = mirrored(source[None])[0] - can.centres
    lit = can.part(np.flatnonzero(np.einsum("fx,fx->f", towards, can.normals) > 0))
    frequencies = scenario.radio.frequencies
    wavelengths = speed_of_light / frequencies
    step = 0.05 * float(wavelengths.mean())

    def one_way(height: float) -> np.ndarray:
        places = lit.centres + height * lit.normals
        links = Links(
            senders=np.broadcast_to(source, places.shape),
            receivers=places,
            sent=ISOTROPIC,
            received=ISOTROPIC,
        )
        look = partial(everything, len(places))
        return np.asarray(scattered_by_patches(wall, links, look, frequencies))

    slope = (one_way(step) - one_way(-step)) / (2 * step)
    twice = -2 / wavelengths * np.einsum("qf,qf,q->f", one_way(0.0), slope, lit.sizes)
    # The wall's edges, three Fresnel zones off the path, ripple by some per cent of the field.
    correlation = abs(np.vdot(twice, found)) / np.linalg.norm(twice) / np.linalg.norm(found)
    level = 20 * np.log10(np.linalg.norm(found) / np.linalg.norm(twice))
    assert correlation >= 0.99
    assert abs(level) <= 0.7
