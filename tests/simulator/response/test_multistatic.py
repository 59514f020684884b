"""The echo between antennas that stand by themselves, on small scenes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.compute import engine
from estimator.measurement.model import Echo
from estimator.measurement.store import read_measurement, write_measurement
from scenes.realisations.object_surface import object_surface
from scenes.scenario import Scenario, parse_scenario
from simulator.geometry.facets import surface_facets
from simulator.geometry.ray_scene import build_scene, facets_visible
from simulator.response import multistatic
from simulator.scattering.physical_optics import scattered
from simulator.scene.radio_scene import facet_ports, radio_scene
from simulator.simulation import simulate

SAMPLE = {
    "kind": "plate",
    "material": "drywall",
    "centre_m": [0.0, 0.1, 0.0],
    "length_m": 0.012,
    "height_m": 0.01,
    "roughness": {"rms_mm": 0.05, "correlation_mm": 0.4},
}
ARC = {
    "kind": "arc",
    "centre_m": [0.0, 0.1],
    "radius_m": 0.1,
    "start_deg": -110.0,
    "stop_deg": -20.0,
    "points": 4,
}
APART: dict[str, Any] = {
    "receivers": ARC,
    "transmitter": {"position_m": [-0.07, 0.03]},
    "antenna": {"kind": "horn", "gain_dbi": 15.0, "aim": "sample"},
}


def scenario(
    *, station: dict[str, Any] = APART, frequencies: int = 3, dimensions: int = 3, **tables: Any
) -> Scenario:
    return parse_scenario(
        {
            "name": "apart",
            "dimensions": dimensions,
            "max_bounces": 1,
            "radio": {"start_ghz": 320.0, "stop_ghz": 330.0, "points": frequencies},
            "base_station": station,
            "objects": {"sample": SAMPLE},
            **tables,
        }
    )


def echo(scene: Scenario, seed: int = 4) -> Echo:
    found = simulate(scene, seed=seed).measurement.echo
    assert found is not None
    return found


def as_a_whole(scene: Scenario, seed: int = 4) -> np.ndarray:
    """All facets at once, rays traced to all, each receiver on its own."""
    frozen = radio_scene(scene, seed=seed, sample=0)
    assert frozen.facets is not None
    station = scene.base_station
    places = station.element_positions
    senders = station.transmit_positions(places)
    assert senders is not None
    rows = []
    for index in range(len(places)):
        transmit, receive = (
            facet_ports(frozen, frozen.facets, antenna, some[index : index + 1])
            for antenna, some in ((station.transmit_antenna, senders), (station.antenna, places))
        )
        rows.append(
            scattered(frozen.facets, transmit, receive, scene.radio.frequencies, waves=scene.waves)[
                0
            ]
        )
    return np.array(rows)


def error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def test_the_tiles_together_are_the_plate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(multistatic, "TILE_CELLS", 37)
    scene = scenario()
    found = echo(scene)
    # Rays of a whole plate start 2 µm above it and miss what shades by less; the tables: 1e-5.
    assert error(found.samples, as_a_whole(scene)) <= 1e-3


def test_many_frequencies_are_summed_over_the_band_and_few_by_themselves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = scenario(frequencies=11)
    few = echo(scene).samples
    monkeypatch.setattr(multistatic, "FEW_FREQUENCIES", 10)
    assert error(echo(scene).samples, few) <= 1e-4  # the tables' accuracy, over 0.3


def test_an_object_before_the_sample_hides_it() -> None:
    screen = {
        "kind": "plate", "material": "absorber", "centre_m": [0.0, 0.05, 0.0],
        "length_m": 0.04, "height_m": 0.1,
    }  # fmt: skip
    scene = scenario(objects={"sample": SAMPLE, "screen": screen})
    hidden, free = echo(scene).samples, echo(scenario()).samples
    assert error(hidden, as_a_whole(scene)) <= 1e-3
    powers = (np.abs(hidden) ** 2).sum(axis=1) / (np.abs(free) ** 2).sum(axis=1)
    # It stands between the sample and the second receiver, and well aside of the last.
    assert powers[1] < 1e-6
    assert powers[3] == pytest.approx(1.0, abs=1e-6)


def test_a_ball_before_the_sample_scatters_and_hides_as_well() -> None:
    post = {"kind": "cylinder", "material": "metal", "centre_m": [0.01, 0.07, 0.0],
            "radius_m": 0.004, "height_m": 0.006}  # fmt: skip
    scene = scenario(objects={"sample": SAMPLE, "post": post})
    assert error(echo(scene).samples, as_a_whole(scene)) <= 2e-3


def test_where_nothing_is_illuminated_nothing_is_summed(monkeypatch: pytest.MonkeyPatch) -> None:
    narrow = {**APART, "antenna": {**APART["antenna"], "gain_dbi": 43.0}}
    monkeypatch.setattr(multistatic, "TILE_CELLS", 20)
    left_out = echo(scenario(station=narrow)).samples
    monkeypatch.setattr(multistatic, "FAINTEST", 0.0)
    whole = echo(scenario(station=narrow)).samples
    difference = np.abs(left_out - whole).max() / np.abs(whole).max()
    assert 0 < difference < 1e-3


def test_in_a_shallow_view_the_sample_does_not_hide_itself_by_its_own_roughness() -> None:
    steep = {**SAMPLE, "roughness": {"rms_mm": 0.1, "correlation_mm": 0.4}}
    grazing = {**APART, "transmitter": {"position_m": [-0.098, 0.085]}}
    scene = scenario(station=grazing, objects={"sample": steep})
    frozen = radio_scene(scene, seed=4, sample=0)
    assert frozen.facets is not None
    place = np.array([[-0.098, 0.085, 0.0]])
    assert facets_visible(frozen.rays, frozen.facets, place).all()
    # Rays among its own facets would have found shadows.
    surface = object_surface(scene, "sample", seed=4)
    rough = surface_facets(replace(surface, mean_vertices=surface.vertices))
    assert facets_visible(build_scene([surface]), rough, place).mean() < 0.9
    assert error(echo(scene).samples, as_a_whole(scene)) <= 1e-3


def test_in_two_dimensions_each_receiver_looks_at_the_sample_too() -> None:
    line = {key: value for key, value in SAMPLE.items() if key != "height_m"}
    scene = scenario(dimensions=2, objects={"sample": line})
    assert error(echo(scene).samples, as_a_whole(scene)) <= 1e-9


def test_a_point_between_antennas_apart_follows_the_radar_equation() -> None:
    station = {**APART, "antenna": {"kind": "isotropic"}}
    point = {"position_m": [0.01, 0.1, 0.005], "rcs_m2": 1e-4}
    found = echo(scenario(station=station, objects={}, points={"p": point}))
    assert found.transmit_positions is not None
    place = np.array(point["position_m"])
    out = np.linalg.norm(place - found.transmit_positions, axis=-1)[:, None]
    back = np.linalg.norm(place - found.positions, axis=-1)[:, None]
    wavelengths = speed_of_light / found.frequencies
    expected = wavelengths * 1e-2 / ((4 * np.pi) ** 1.5 * out * back)
    expected = expected * np.exp(-2j * np.pi * (out + back) / wavelengths)
    np.testing.assert_allclose(found.samples, expected, rtol=1e-10)


def test_the_file_says_where_the_transmitter_stood(tmp_path: Path) -> None:
    measurement = simulate(scenario(), seed=1).measurement
    write_measurement(tmp_path / "it.zarr", measurement)
    again = read_measurement(tmp_path / "it.zarr").echo
    assert again is not None
    assert again.transmit_positions is not None
    np.testing.assert_array_equal(again.transmit_positions, [[-0.07, 0.03, 0.0]] * 4)
    np.testing.assert_array_equal(again.positions, scenario().base_station.element_positions)


def test_the_same_seed_gives_the_same_bytes_on_one_thread_and_on_two() -> None:
    before = engine.thread_count()
    found = []
    for threads in (1, 2):
        dr.set_thread_count(threads)
        found.append(echo(scenario()).samples)
    dr.set_thread_count(before)
    np.testing.assert_array_equal(found[0], found[1])


def test_the_progress_counts_every_receiver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(multistatic, "TILE_CELLS", 37)
    told: list[tuple[str, int, int]] = []
    simulate(scenario(), seed=0, progress=lambda *step: told.append(step))
    assert told == [("echo", done + 1, 4) for done in range(4)]
