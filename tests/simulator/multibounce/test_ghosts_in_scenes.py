"""Ghosts and pilots over two walls in whole scenarios."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.scenario import Scenario, ScenarioError, parse_scenario
from simulator.scattering.physical_optics import scattered
from simulator.scene.radio_scene import facet_ports, radio_scene
from simulator.simulation import simulate
from simulator.visibility import mutual_visibility

WALL = {
    "kind": "plate",
    "material": "metal",
    "centre_m": [0.0, 0.4],
    "angle_deg": 45.0,
    "length_m": 0.12,
    "roughness": {"rms_mm": 0.02, "correlation_mm": 0.6},
}
SECOND = {**WALL, "centre_m": [0.4, 0.4], "angle_deg": -45.0}
POST = {"kind": "cylinder", "material": "metal", "centre_m": [0.25, 0.4], "radius_m": 0.004}
SHADE = {
    "kind": "plate",
    "material": "absorber",
    "centre_m": [0.15, 0.15],
    "angle_deg": 90.0,
    "length_m": 0.36,
}
USER = {
    "position_m": [0.4, 0.0],
    "antenna": {"kind": "gaussian_beam", "sigma_rad": 0.08, "aim_deg": 90.0},
}


def scenario(**tables: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "small",
            "radio": {"start_ghz": 220.0, "stop_ghz": 250.0, "points": 101},
            "base_station": {"elements": 3, "spacing_mm": 4.0},
            **tables,
        }
    )


def echo(scene: Scenario) -> np.ndarray:
    found = simulate(scene, seed=1).measurement.echo
    assert found is not None
    return np.asarray(found.samples)


def plain(scene: Scenario) -> np.ndarray:
    """One bounce: physical optics over all facets."""
    made = radio_scene(scene, seed=1, sample=0)
    assert made.facets is not None
    station = scene.base_station
    ports = facet_ports(made, made.facets, station.antenna, station.element_positions)
    field = scattered(made.facets, ports, ports, scene.radio.frequencies, waves=scene.waves)
    return np.asarray(field)


def test_one_bounce_is_plain_physical_optics() -> None:
    objects = {"wall": WALL, "post": POST}
    scene = scenario(objects=objects, max_bounces=1)
    np.testing.assert_array_equal(echo(scene), plain(scene))
    more = echo(scenario(objects=objects))
    assert np.linalg.norm(more - echo(scene)) > 1e-3 * np.linalg.norm(more)


def test_a_wall_alone_has_no_more_than_one_bounce() -> None:
    scene = scenario(objects={"wall": WALL})
    np.testing.assert_array_equal(echo(scene), plain(scene))


def test_the_ghost_of_a_hidden_post_lies_at_its_length_over_the_wall() -> None:
    objects = {"wall": WALL, "post": POST, "shade": SHADE}
    scene = scenario(objects=objects)
    ghost = echo(scene) - plain(scene)
    frequencies = scene.radio.frequencies
    step = frequencies[1] - frequencies[0]
    profile = np.abs(np.fft.ifft(ghost[1] * np.hanning(101), 16 * 101))
    length = np.argmax(profile) / (16 * 101 * step) * speed_of_light
    # 0.4 m to the wall, 0.246 m to the post's front, and back, beyond the 1 m that the step of
    # frequency tells apart; the cell is c/2B = 5 mm, and the peak is found to a fifth of it.
    assert (length + speed_of_light / step) / 2 == pytest.approx(0.646, abs=1e-3)


def test_over_two_rough_walls_the_pilot_is_that_of_the_image() -> None:
    objects = {"one": WALL, "two": SECOND}
    radio = {"start_ghz": 220.0, "stop_ghz": 250.0, "points": 16}
    tables: dict[str, Any] = {"objects": objects, "users": {"user": USER}, "radio": radio}
    scene = scenario(**tables, max_bounces=2)
    (uplink,) = simulate(scene, seed=1).measurement.uplinks
    lengths = np.linalg.norm(scene.base_station.element_positions - [0.0, 1.2, 0.0], axis=-1)
    wavelengths = speed_of_light / scene.radio.frequencies
    phase = 2 * np.pi * lengths[:, None] / wavelengths
    image = wavelengths / (4 * np.pi * lengths[:, None]) * np.exp(-1j * phase)
    ratio = np.mean(uplink.samples / image)
    # Coherent loss of two walls, exp(-4(k·rms·cos 45°)²) = 0.98, and up to 10 % of Fresnel ripple
    # of the walls' ends; half the level would be the loss of one path too many or too few.
    assert abs(ratio - 0.98) <= 0.15
    dropped = scenario(**tables, max_bounces=1)
    (alone,) = simulate(dropped, seed=1).measurement.uplinks
    assert np.mean(np.abs(alone.samples)) < 0.2 * np.mean(np.abs(uplink.samples))


def test_too_many_pairs_of_facets_are_refused_with_a_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(mutual_visibility, "MOST_PAIRS", 1000)
    with pytest.raises(ScenarioError, match=r"max_bounces.*more than 1e\+03.*set max_bounces = 1"):
        simulate(scenario(objects={"wall": WALL, "post": POST}), seed=1)
