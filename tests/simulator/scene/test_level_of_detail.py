"""Large smooth faces are mirrors without facets, and many mirrors are found by rays."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.constants import speed_of_light

from scenes.scenario import Scenario, ScenarioError, parse_scenario
from simulator.antennas.antenna_pattern import ISOTROPIC
from simulator.antennas.beam_culling import AntennaGroup
from simulator.geometry.mean_surfaces import mean_mirrors, mean_surfaces
from simulator.geometry.ray_scene import blocked, build_scene
from simulator.scene import level_of_detail, scene_mirrors
from simulator.scene.radio_scene import radio_scene, scenario_materials
from simulator.simulation import simulate
from simulator.specular import image_sources, ray_launching
from simulator.specular.image_method import find_chains
from simulator.specular.ray_launching import launched_sequences

USER = [3.0, -2.0, 0.5]
WALL = {
    "kind": "plate",
    "material": "metal",
    "centre_m": [0.0, 5.0, 0.0],
    "length_m": 30.0,
    "height_m": 20.0,
}


def scenario(
    objects: dict[str, Any], *, bounces: int = 1, user: list[float] | None = None, **more: Any
) -> Scenario:
    return parse_scenario(
        {
            "name": "hall",
            "dimensions": 3,
            "max_bounces": bounces,
            "radio": {"start_ghz": 59.9, "stop_ghz": 60.1, "points": 5},
            "base_station": {"elements": 3, "spacing_mm": 2.5},
            "objects": objects,
            "users": {"ann": {"position_m": user or USER}},
            **more,
        }
    )


def test_a_large_smooth_wall_reflects_like_the_image_of_the_user_without_a_facet() -> None:
    hall = scenario({"wall": WALL})
    assert radio_scene(hall, seed=0, sample=0).facets is None
    pilot = simulate(hall, seed=0).measurement.uplinks[0].samples
    elements, frequencies = hall.base_station.element_positions, hall.radio.frequencies
    expected = np.zeros(pilot.shape, dtype=np.complex128)
    for place, sign in (
        (np.array(USER), 1.0),
        (np.array([USER[0], 10.0 - USER[1], USER[2]]), -1.0),
    ):
        apart = place - elements
        length = np.linalg.norm(apart, axis=-1)
        # Vertical fields at both ends: z across the ray, once for each end.
        along = np.sqrt(1 - (apart[:, 2] / length) ** 2)
        level = sign * speed_of_light / frequencies / (4 * np.pi * length[:, None])
        phase = -2j * np.pi * frequencies * length[:, None] / speed_of_light
        fields = _fields(apart / length[:, None], along)
        expected += level * fields[:, None] * np.exp(phase)
    # The wall's edges, v = 117 Fresnel widths off, leave 1/(√2 π v) each.
    np.testing.assert_allclose(pilot, expected, rtol=0, atol=4 * 0.002 * np.abs(expected).max())


def _fields(ways: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Product of the vertical antennas' field vectors on a ray.

    A conductor at y = const turns the tangential field by -1 and leaves its normal component:
    minus the field of the image of a vertical antenna, which is vertical itself.
    """
    up = np.array([0.0, 0.0, 1.0])
    field = (up - ways * ways[:, 2:]) / along[:, None]
    return np.asarray(np.einsum("ex,ex->e", field, field))


def test_the_echo_of_a_large_smooth_wall_is_the_antennas_own_image() -> None:
    hall = scenario({"wall": WALL})
    echo = simulate(hall, seed=0).measurement.echo
    assert echo is not None
    level = speed_of_light / hall.radio.frequencies / (4 * np.pi * 10.0)
    phase = np.exp(-2j * np.pi * hall.radio.frequencies * 10.0 / speed_of_light)
    # Of the wall's edges, v = 126 and more Fresnel widths off.
    np.testing.assert_allclose(echo.samples, np.tile(-level * phase, (3, 1)), rtol=4 * 0.002)


def test_facets_and_images_agree_up_to_what_the_edges_scatter(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wall = WALL | {"centre_m": [0.5, 1.0, 0.2], "length_m": 0.9, "height_m": 0.9}
    hall = scenario({"wall": wall}, user=[0.9, 0.2, 0.3], effects={"line_of_sight": False})
    pilots = []
    for most in (level_of_detail.MOST_SMOOTH, 0):
        monkeypatch.setattr(level_of_detail, "MOST_SMOOTH", most)
        pilots.append(simulate(hall, seed=0).measurement.uplinks[0].samples)
    # Of a straight edge at clearance v, Fresnel's integrals leave 1/(√2 π v): four edges, at
    # v = √2 h/r₁ = 0.4 m √2 / √(λ r r'/(r + r')) = 10 or more.
    assert np.linalg.norm(pilots[0] - pilots[1]) < 4 * 0.0225 * np.linalg.norm(pilots[0])


def test_what_is_rough_curved_or_small_keeps_its_facets() -> None:
    rough = {"rms_mm": 0.1, "correlation_mm": 8.0}  # long: facets of a quarter wavelength
    objects = {
        "smooth": WALL,
        "rough": WALL
        | {"centre_m": [0, -4, 0], "length_m": 0.5, "height_m": 0.5, "roughness": rough},
        "post": {
            "kind": "cylinder", "material": "metal", "centre_m": [1, 2, 0], "radius_m": 0.05,
            "height_m": 0.2,
        },
        "cube": {
            "kind": "box", "material": "metal", "centre_m": [-1, 2, 0], "length_m": 0.1,
            "depth_m": 0.1, "height_m": 0.1,
        },
    }  # fmt: skip
    made = radio_scene(scenario(objects), seed=0, sample=0)
    assert set(made.scattering) == {"rough", "post", "cube"}


def test_a_closed_mesh_with_antennas_in_it_is_a_room_in_a_foreign_scene(tmp_path: Path) -> None:
    trimesh.creation.box((10.0, 12.0, 5.0)).export(tmp_path / "room.ply")
    (tmp_path / "room.xml").write_text(
        '<scene version="2.1.0"><bsdf type="itu-radio-material" id="mat-metal">'
        '<string name="type" value="metal"/></bsdf><shape type="ply" id="mesh-room">'
        '<string name="filename" value="room.ply"/><ref id="mat-metal" name="bsdf"/></shape>'
        "</scene>"
    )
    table = {"file": str(tmp_path / "room.xml")}
    room = scenario({}, geometry=table)
    assert getattr(room.objects["room"], "hollow", False)
    # The direct wave, and the room's six walls: 1/L each, the angle of the fields apart.
    pilot = simulate(room, seed=0).measurement.uplinks[0].samples
    bare = simulate(scenario({}), seed=0).measurement.uplinks[0].samples
    assert np.abs(pilot - bare).max() > 0.1 * np.abs(bare).max()
    solid = table | {"objects": {"room": {"hollow": False}}}
    with pytest.raises(
        ScenarioError, match=r"inside objects\.room.* set hollow = true if it is a "
    ):
        scenario({}, geometry=solid)


def test_rays_meet_every_sequence_of_mirrors_that_has_a_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ray_launching, "RAYS", 2**16)
    walls = {
        name: WALL | {"centre_m": centre, "angle_deg": angle, "length_m": 10.0, "height_m": 5.0}
        for name, centre, angle in (
            ("north", [0, 5, 0], 0.0),
            ("south", [0, -5, 0], 0.0),
            ("east", [5, 0, 0], 90.0),
            ("west", [-5, 0, 0], 80.0),
        )
    }
    box = {"kind": "box", "material": "metal", "centre_m": [-1.5, 1.0, 0.0], "angle_deg": 20.0,
           "length_m": 1.0, "depth_m": 0.5, "height_m": 2.0}  # fmt: skip
    hall = scenario({**walls, "box": box}, bounces=3)
    surfaces, materials = mean_surfaces(hall), scenario_materials(hall)
    mirrors, rays = mean_mirrors(hall, surfaces, materials), build_scene(surfaces)
    array = AntennaGroup(positions=np.zeros((1, 3)), pattern=ISOTROPIC)
    common: dict[str, Any] = {"blocked": partial(blocked, rays), "clearance": rays.clearance}
    tried = find_chains(mirrors, array.positions, np.array([USER]), **common)
    met = launched_sequences(mirrors, [array], 3)
    found = find_chains(mirrors, array.positions, np.array([USER]), **common, among=met)
    assert len(tried) > 20
    assert [chain.mirrors for chain in found] == [chain.mirrors for chain in tried]


def test_a_scene_simulates_the_same_whether_all_sequences_are_tried_or_rays_launched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hall = scenario({"wall": WALL, "other": WALL | {"centre_m": [0.0, -5.0, 0.0]}}, bounces=3)
    tried = simulate(hall, seed=0).measurement
    monkeypatch.setattr(image_sources, "MOST_LEGS", 1)
    monkeypatch.setattr(ray_launching, "RAYS", 2**14)
    launched = simulate(hall, seed=0).measurement
    np.testing.assert_array_equal(launched.uplinks[0].samples, tried.uplinks[0].samples)
    monkeypatch.setattr(scene_mirrors, "MOST_LAUNCHED", 1)
    with pytest.raises(ScenarioError, match="max_bounces = 3: the antennas reach more than 1 ways"):
        simulate(hall, seed=0)
