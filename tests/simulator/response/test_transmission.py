"""Waves through slabs in whole scenes: pilots, echoes, chains and points."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.scenario import Scenario, parse_scenario
from simulator.scene.scenario_paths import scenario_paths
from simulator.simulation import simulate

SMOOTH = {"rms_mm": 0.0, "correlation_mm": 1.0}
DRYWALL = {
    "kind": "plate", "material": {"name": "drywall", "thickness_mm": 12.0}, "roughness": SMOOTH,
    "centre_m": [0.0, 0.5], "length_m": 1.0,
}  # fmt: skip
METAL = {"kind": "plate", "material": "metal", "centre_m": [0.0, 1.0], "length_m": 0.1}
USER = {"user": {"position_m": [0.05, 1.4]}}


def scene(dimensions: int, objects: dict[str, Any], **more: Any) -> Scenario:
    tall = {"height_m": 0.1} if dimensions == 3 else {}
    return parse_scenario(
        {
            "name": "made",
            "dimensions": dimensions,
            "max_bounces": 1,
            "radio": {"start_ghz": 60.0, "stop_ghz": 61.0, "points": 5},
            "base_station": {"elements": 3, "spacing_mm": 2.5},
            "objects": {name: tall | body for name, body in objects.items()},
            **more,
        }
    )


def airy(angle: float, thickness: float, frequencies: np.ndarray) -> np.ndarray:
    """Transmission of plasterboard (P.2040-4: ε = 2.73, σ = 0.0085 f^0.9395), field across.

    Summed echo by echo, over the air in its place; the simulator has the closed form.
    """
    giga = frequencies / 1e9
    permittivity = 2.73 - 17.98j * 0.0085 * giga**0.9395 / giga
    inner = np.sqrt(permittivity - np.sin(angle) ** 2)
    face = (np.cos(angle) - inner) / (np.cos(angle) + inner)
    wavenumber = 2 * np.pi * frequencies / speed_of_light
    once = np.exp(-1j * wavenumber * thickness * inner)
    echoes = sum((face * once) ** (2 * number) for number in range(60))
    through = (1 - face**2) * once * echoes
    over_air: np.ndarray = through * np.exp(1j * wavenumber * thickness * np.cos(angle))
    return over_air


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_user_behind_drywall_arrives_as_airys_formula_says(dimensions: int) -> None:
    """With the drywall far off the facets' reach only the straight way is there."""
    tall = {"height_m": 0.1} if dimensions == 3 else {}
    wall = DRYWALL | {"length_m": 0.3} | tall
    scenes = [
        scene(dimensions, objects, users=USER, max_bounces=0) for objects in ({"wall": wall}, {})
    ]
    behind, free = (simulate(one, seed=0).measurement.uplinks[0].samples for one in scenes)
    elements = scenes[0].base_station.element_positions
    away = np.array(USER["user"]["position_m"]) - elements[:, :2]
    for row, (across, along) in enumerate(away):
        expected = airy(np.arctan2(abs(across), along), 12e-3, scenes[0].radio.frequencies)
        ratio = behind[row] / free[row]
        # The front curves as from 12 mm · (1 - 1/1.65) nearer, of 1.4 m: 0.3 %, or half of it.
        assert np.abs(ratio / expected - 1).max() <= 0.005


def test_a_strip_behind_drywall_echoes_through_it_twice() -> None:
    frequencies = scene(2, {}).radio.frequencies
    for dimensions in (2, 3):
        glass = DRYWALL | ({"height_m": 0.3, "length_m": 0.3} if dimensions == 3 else {})
        with_wall, alone, wall = (
            simulate(scene(dimensions, objects), seed=0).measurement.echo
            for objects in ({"wall": glass, "strip": METAL}, {"strip": METAL}, {"wall": glass})
        )
        if with_wall is None or alone is None or wall is None:
            raise AssertionError("all three echo")
        ratio = (with_wall.samples - wall.samples) / alone.samples
        expected = airy(0.0, 12e-3, frequencies) ** 2
        # Edges of the strip are seen at up to 3°; the front's curvature gives 0.5 % a way.
        assert np.abs(ratio / expected - 1).max() <= 0.03


def test_what_lets_nothing_through_blocks() -> None:
    for material in ({"name": "drywall", "thickness_mm": float("inf")}, "metal", "concrete"):
        wall = DRYWALL | {"material": material}
        assert simulate(scene(2, {"wall": wall}, users=USER), seed=0).measurement.uplinks == ()


def test_the_effect_can_be_switched_off() -> None:
    off = scene(2, {"wall": DRYWALL}, users=USER, effects={"transmission": False})
    assert simulate(off, seed=0).measurement.uplinks == ()
    dark = scene(2, {"wall": DRYWALL}, users=USER, effects={"line_of_sight": False}, max_bounces=0)
    assert scenario_paths(dark) == ()


def test_the_truth_lists_the_path_through_the_wall_with_its_loss() -> None:
    (path,) = scenario_paths(scene(2, {"wall": DRYWALL}, users=USER))
    assert (path.bounces, path.through) == (0, ("wall",))
    expected = airy(np.arctan2(0.05, 1.4), 12e-3, np.array([60.5e9]))
    assert path.transmission_db == pytest.approx(20 * np.log10(abs(expected[0])), abs=0.05)


def test_a_ghost_is_seen_through_a_slab_between_mirror_and_target() -> None:
    """A leg between two bodies crosses the slab once, in an echo that takes it once each way."""
    mirror = {
        "kind": "plate", "material": "metal", "centre_m": [0.0, 0.6], "angle_deg": 45.0,
        "length_m": 0.2,
    }  # fmt: skip
    post = {"kind": "cylinder", "material": "metal", "centre_m": [0.5, 0.6], "radius_m": 0.02}
    # Before the post, hidden from the array by a screen; the way mirror-post crosses it.
    pane = DRYWALL | {"centre_m": [0.3, 0.6], "angle_deg": 90.0, "length_m": 0.3}
    screen = {"kind": "plate", "material": "absorber", "centre_m": [0.2, 0.25], "length_m": 0.3,
              "angle_deg": 135.0}  # fmt: skip
    objects = {"mirror": mirror, "post": post, "screen": screen}

    def ghost(objects: dict[str, Any]) -> np.ndarray:
        echoes = [
            simulate(scene(2, objects, max_bounces=bounces), seed=0).measurement.echo
            for bounces in (3, 1)
        ]
        return np.asarray(echoes[0].samples - echoes[1].samples)  # type: ignore[union-attr]

    without_post = {name: one for name, one in objects.items() if name != "post"}
    with_pane = ghost({**objects, "pane": pane}) - ghost({**without_post, "pane": pane})
    ratio = with_pane / ghost(objects)
    expected = airy(0.0, 12e-3, scene(2, {}).radio.frequencies) ** 2
    # The post is 8 wavelengths wide; over it and the array, angles at the pane reach some 6°.
    assert np.abs(ratio / expected - 1).max() <= 0.1


def test_a_point_behind_a_wall_echoes_through_it_twice() -> None:
    points = {"points": {"point": {"position_m": [0.0, 1.0], "rcs_m2": 0.01}}}
    wall = DRYWALL | {"length_m": 0.3}
    both = [
        simulate(scene(2, objects, max_bounces=0, **points), seed=0).measurement.echo
        for objects in ({"wall": wall}, {})
    ]
    ratio = both[0].samples / both[1].samples  # type: ignore[union-attr]
    expected = airy(0.0, 12e-3, scene(2, {}).radio.frequencies) ** 2
    assert np.abs(ratio / expected - 1).max() <= 0.01  # curvature: 0.5 % a way


def test_a_link_through_slabs_is_reciprocal() -> None:
    ends = [0.3, 1.4], [-0.1, 0.1]
    links = []
    for here, there in (ends, ends[::-1]):
        one = scene(
            2,
            {"wall": DRYWALL | {"angle_deg": 20.0}, "strip": METAL | {"angle_deg": 30.0}},
            users={"user": {"position_m": there}},
            base_station={"elements": 1, "spacing_mm": 1.0, "position_m": here},
            max_bounces=1,
        )
        links.append(simulate(one, seed=0).measurement.uplinks[0].samples)
    assert np.allclose(links[0], links[1], rtol=1e-4)  # the sum's accuracy, and node counts
