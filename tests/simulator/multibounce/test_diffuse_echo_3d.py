"""The diffuse part of echoes and pilots in space over several surfaces."""

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
from simulator.multibounce.diffuse_echo_3d import diffuse_echo
from simulator.multibounce.diffuse_field_3d import diffuse_wave
from simulator.multibounce.multibounce_3d import coherent_echo
from simulator.scattering.patch_sum import scattered_by_patches
from simulator.scene.array_antennas import array_group
from simulator.scene.radio_scene import RadioScene, radio_scene
from simulator.specular.diffuse_chains import diffuse_legs
from simulator.visibility.seen import Seen

SEEDS = 40

RECIPROCITY = 0.01
"""Two ways to the same sum; the target's amplitude is looked up for either end's middle. [-]"""


def scene(
    *,
    rms_mm: float,
    seed: int = 0,
    size_m: tuple[float, float] = (0.6, 0.4),
    points: int = 21,
    more: Any = None,
    **station: Any,
) -> tuple[Scenario, RadioScene]:
    """A can behind a screen, seen over a rough wall at 45° only."""
    scenario = parse_scenario(
        {
            "name": "ghost", "dimensions": 3, "max_bounces": 3,
            "radio": {"start_ghz": 28.0, "stop_ghz": 32.0, "points": points},
            "base_station": {
                "elements": [2, 2], "spacing_mm": 8.0,
                "antenna": {"kind": "horn", "gain_dbi": 15.0},
            } | station,
            "objects": {
                "wall": {
                    "kind": "plate", "material": "metal", "centre_m": [0.0, 0.8, 0.0],
                    "angle_deg": 45.0, "length_m": size_m[0], "height_m": size_m[1],
                    "roughness": {"rms_mm": rms_mm, "correlation_mm": 8.0},
                },
                "can": {
                    "kind": "cylinder", "material": "metal", "centre_m": [0.6, 0.8, 0.0],
                    "radius_m": 0.02, "height_m": 0.03,
                },
                "screen": {
                    "kind": "plate", "material": "absorber", "centre_m": [0.25, 0.4, 0.0],
                    "angle_deg": 100.0, "length_m": 0.6, "height_m": 0.5,
                },
                **(more or {}),
            },
        }
    )  # fmt: skip
    return scenario, radio_scene(scenario, seed=seed, sample=0)


def everything(count: int, some: Int[np.ndarray, " some"]) -> Seen:
    return Seen(
        always=np.ones(len(some), dtype=bool),
        sometimes=np.empty(0, dtype=np.int64),
        table=np.empty((0, count), dtype=bool),
    )


def physical_optics_twice(made: RadioScene, source: np.ndarray, pattern: Any) -> np.ndarray:
    """One-way waves over the wall's facets at each facet of the can, linked by reciprocity."""
    frequencies = made.scenario.radio.frequencies
    wall, can = made.facets_of("wall"), made.facets_of("can")
    image = np.array([source[1] - 0.8, source[0] + 0.8, source[2]])
    lit = can.part(np.flatnonzero(np.einsum("fx,fx->f", image - can.centres, can.normals) > 0))
    wavelengths = speed_of_light / frequencies
    step = 0.05 * float(wavelengths.mean())

    def one_way(height: float) -> np.ndarray:
        places = lit.centres + height * lit.normals
        links = Links(
            senders=np.broadcast_to(source, places.shape),
            receivers=places,
            sent=pattern,
            received=ISOTROPIC,
        )
        look = partial(everything, len(places))
        return np.asarray(scattered_by_patches(wall, links, look, frequencies))

    slope = (one_way(step) - one_way(-step)) / (2 * step)
    return np.asarray(-2 / wavelengths * np.einsum("qf,qf,q->f", one_way(0.0), slope, lit.sizes))


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    return float(abs(np.vdot(one, other)) / np.linalg.norm(one) / np.linalg.norm(other))


def level(one: np.ndarray, other: np.ndarray) -> float:
    return float(20 * np.log10(np.linalg.norm(one) / np.linalg.norm(other)))


@pytest.mark.slow
def test_a_ghost_over_a_rough_wall_is_that_of_physical_optics_twice() -> None:
    found, twice, coherent = [], [], []
    for seed in range(3):
        scenario, made = scene(rms_mm=1.0, seed=seed)
        array = array_group(scenario, made.elements)
        coherent.append(coherent_echo(made, array, array)[0])
        found.append(coherent[-1] + diffuse_echo(made, array, array)[0])
        twice.append(physical_optics_twice(made, array.positions[0], array.pattern))
    # Measured: 0.978 (the coherent part alone: 0.536) and +0.2 dB.
    assert correlation(np.stack(coherent), np.stack(twice)) < 0.9
    assert correlation(np.stack(found), np.stack(twice)) >= 0.95
    assert abs(level(np.stack(found), np.stack(twice))) <= 0.7


def test_a_smooth_mirror_scatters_nothing_diffusely() -> None:
    """Neither does one whose heights are far below a wavelength: (k rms)² of the power."""
    scenario, made = scene(rms_mm=0.002, size_m=(0.2, 0.1))
    array = array_group(scenario, made.elements)
    diffuse, coherent = diffuse_echo(made, array, array), coherent_echo(made, array, array)
    assert 0 < np.linalg.norm(diffuse) < 0.02 * np.linalg.norm(coherent)


@pytest.mark.slow
def test_the_diffuse_part_has_no_mean_over_realisations() -> None:
    """A one-way wave's mean over seeds is zero, by a z-test in each real component."""
    waves = []
    for seed in range(SEEDS):
        scenario, made = scene(rms_mm=1.0, size_m=(0.12, 0.06), seed=seed, points=3)
        assert made.mirrors is not None
        array = array_group(scenario, made.elements)
        place = AntennaGroup(positions=np.array([[0.55, 0.8, 0.0]]), pattern=ISOTROPIC)
        (chain,) = diffuse_legs(made.mirrors.mirrors, made.mirrors.legs[:1])
        waves.append(diffuse_wave(made, chain, array, place)[0, 1])
    parts = np.array(waves).view(np.float64).reshape(SEEDS, 2)
    assert parts.std() > 0
    z = parts.mean(axis=0) / (parts.std(axis=0, ddof=1) / SEEDS**0.5)
    assert np.abs(z).max() <= 3.5  # by chance once in a thousand


def test_transmitter_and_receiver_may_change_places() -> None:
    scenario, made = scene(rms_mm=0.8, size_m=(0.2, 0.1))
    here = array_group(scenario, made.elements)
    there = AntennaGroup(
        positions=here.positions + np.array([0.03, 0.0, 0.01]), pattern=here.pattern
    )
    one, other = diffuse_echo(made, here, there), diffuse_echo(made, there, here)
    assert np.linalg.norm(one) > 0
    assert np.linalg.norm(one - other) <= RECIPROCITY * np.linalg.norm(one)


def test_a_pilot_over_a_mirror_and_a_rough_wall_comes_from_the_users_image() -> None:
    aside = {
        "kind": "plate", "material": "metal", "centre_m": [1.0, 0.8, 0.0], "angle_deg": 45.0,
        "length_m": 1.2, "height_m": 0.6,
    }  # fmt: skip
    options: Any = {"rms_mm": 1.0, "size_m": (0.2, 0.06), "antenna": {"kind": "isotropic"}}
    _, both = scene(more={"aside": aside}, **options)
    scenario, alone = scene(**options)
    assert both.mirrors is not None
    assert alone.mirrors is not None
    array = array_group(scenario, alone.elements)
    user = AntennaGroup(positions=np.array([[1.0, 1.2, 0.12]]), pattern=ISOTROPIC)
    image = AntennaGroup(
        positions=np.array([[1.4, 0.8, 0.12]]), pattern=ISOTROPIC
    )  # in y = x - 0.2
    chains = diffuse_legs(both.mirrors.mirrors, both.mirrors.chains)
    chain = next(one for one in chains if one.leg.sequence == (0, 1) and one.rough == 0)
    (single,) = (one for one in diffuse_legs(alone.mirrors.mirrors, alone.mirrors.legs[:1]))
    found = diffuse_wave(both, chain, array, user)
    expected = -diffuse_wave(alone, single, array, image)  # a conductor turns the field round
    assert np.linalg.norm(expected) > 0
    assert np.linalg.norm(found - expected) <= 1e-3 * np.linalg.norm(expected)


def test_a_pilot_over_two_mirrors_and_a_rough_wall_comes_from_the_image_of_the_users_image() -> (
    None
):
    flat = {"kind": "plate", "material": "metal", "length_m": 1.2, "height_m": 0.6}
    more = {
        "aside": flat | {"centre_m": [1.0, 0.8, 0.0], "angle_deg": 45.0},  # y = x - 0.2
        "above": flat | {"centre_m": [1.0, 1.6, 0.0], "angle_deg": 0.0},
    }
    options: Any = {"rms_mm": 1.0, "size_m": (0.2, 0.06), "antenna": {"kind": "isotropic"}}
    _, all_three = scene(more=more, **options)
    scenario, alone = scene(**options)
    assert all_three.mirrors is not None
    assert alone.mirrors is not None
    array = array_group(scenario, alone.elements)
    # So high that the can is in nobody's way.
    user = AntennaGroup(positions=np.array([[1.0, 1.2, 0.25]]), pattern=ISOTROPIC)
    image = AntennaGroup(positions=np.array([[2.2, 0.8, 0.25]]), pattern=ISOTROPIC)
    chains = diffuse_legs(all_three.mirrors.mirrors, all_three.mirrors.chains)
    chain = next(one for one in chains if one.leg.sequence == (0, 1, 2) and one.rough == 0)
    (single,) = (one for one in diffuse_legs(alone.mirrors.mirrors, alone.mirrors.legs[:1]))
    found = diffuse_wave(all_three, chain, array, user)
    expected = diffuse_wave(alone, single, array, image)  # two conductors turn it round twice
    assert np.linalg.norm(expected) > 0
    assert np.linalg.norm(found - expected) <= 1e-3 * np.linalg.norm(expected)
