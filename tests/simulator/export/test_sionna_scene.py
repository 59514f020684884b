import math

import numpy as np
import pytest
import sionna.rt as rt
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario
from scenes.scenario import Scenario, parse_scenario
from simulator.export.sionna_scene import sionna_scene, stand_back
from simulator.geometry.mean_surfaces import mean_surfaces
from simulator.materials.permittivity import MaterialError
from simulator.materials.sionna_materials import scattering_coefficient


def solve(scene: rt.Scene, **options: object) -> rt.Paths:
    scene.tx_array = scene.rx_array = rt.PlanarArray(
        num_rows=1, num_cols=1, pattern="iso", polarization="V"
    )
    return rt.PathSolver(deterministic=True)(
        scene, max_depth=2, refraction=False, synthetic_array=False, **options
    )


def room() -> Scenario:
    return parse_scenario(
        {
            "name": "corner",
            "dimensions": 3,
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 11},
            "base_station": {"elements": 4, "spacing_mm": 0.5},
            "objects": {
                "wall": {
                    "kind": "plate", "material": "drywall", "centre_m": [0.0, 0.8],
                    "angle_deg": 45.0, "length_m": 0.4, "height_m": 0.3,
                    "roughness": {"rms_mm": 0.05, "correlation_mm": 40.0},
                },
                "screen": {
                    "kind": "plate", "material": "absorber", "centre_m": [0.5, 0.3],
                    "angle_deg": 90.0, "length_m": 0.2, "height_m": 0.3,
                },
                "carton": {
                    "kind": "box", "material": "cardboard", "centre_m": [-0.6, 0.9],
                    "length_m": 0.1, "depth_m": 0.1, "height_m": 0.1,
                    "roughness": {"rms_mm": 0.0, "correlation_mm": 1.0},
                },
            },
            "users": {"user": {"position_m": [1.0, 0.8]}},
        }
    )  # fmt: skip


def test_sionnas_solver_finds_the_users_path_over_the_wall_of_slam_2d() -> None:
    paths = solve(sionna_scene(load_scenario("slam_2d")))
    lengths = np.sort(speed_of_light * paths.tau.numpy().ravel())
    # In plain sight (Sionna's isotropic user has no beam), and over the wall's centre:
    # single precision gives 1 m to 0.1 µm.
    np.testing.assert_allclose(lengths[-2:], [math.hypot(1.0, 0.8), 1.8], atol=1e-6)


def test_the_specular_path_loses_what_the_roughness_scatters() -> None:
    levels = []
    for rms in (0.0, 0.15):
        scenario = load_scenario("slam_2d", [f"objects.wall.roughness.rms_mm={rms}"])
        paths = solve(sionna_scene(scenario), los=False)
        amplitude = paths.a[0].numpy() + 1j * paths.a[1].numpy()
        levels.append(float(np.abs(amplitude).max()))
    wavenumber = 2 * np.pi * 257.5e9 / speed_of_light
    coherent = math.exp(-2 * (wavenumber * 0.15e-3 * math.cos(math.pi / 4)) ** 2)
    assert levels[1] / levels[0] == pytest.approx(coherent, rel=1e-4)  # single precision


def test_every_material_follows_the_frequency_of_the_scene() -> None:
    scene = sionna_scene(room(), frequency=230e9)
    before = {
        name: (made.conductivity[0], made.scattering_coefficient[0], made.thickness[0])
        for name, made in scene.radio_materials.items()
    }
    assert before["/wall"][1] == pytest.approx(scattering_coefficient(0.05e-3, 230e9), rel=1e-5)
    assert before["/wall"][2] == pytest.approx(12.7e-3)
    scene.frequency = 290e9
    wall, carton = scene.radio_materials["/wall"], scene.radio_materials["/carton"]
    # P.2040-4: conductivity as f^1.7799; ε'' constant: as f, the opaque layer as 1/f
    growth = (290 / 230) ** 1.7799
    assert wall.conductivity[0] / before["/wall"][0] == pytest.approx(growth, rel=1e-5)
    assert wall.scattering_coefficient[0] == pytest.approx(
        scattering_coefficient(0.05e-3, 290e9), rel=1e-5
    )
    assert carton.conductivity[0] / before["/carton"][0] == pytest.approx(290 / 230, rel=1e-5)
    assert carton.thickness[0] / before["/carton"][2] == pytest.approx(230 / 290, rel=1e-5)


def test_a_frequency_that_a_material_is_not_known_at_is_refused() -> None:
    scene = sionna_scene(room())
    with pytest.raises(MaterialError, match="covers 110-330 GHz"):
        scene.frequency = 400e9


def test_sionnas_radio_map_lights_the_shadow_side_over_the_wall_only() -> None:
    scene = sionna_scene(load_scenario("slam_2d"), half_height=0.2)
    scene.tx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    found = rt.RadioMapSolver()(
        scene, center=[-0.5, 0.8, -0.02], orientation=[0.0, 0.0, 0.0], size=[0.2, 0.1],
        cell_size=[0.1, 0.1], samples_per_tx=100_000, max_depth=1, refraction=False, los=True,
    )  # fmt: skip
    # Straight behind the wall, as the user sees it, nothing arrives.
    assert found.path_gain.numpy().max() == 0.0


def test_mean_surfaces_are_smooth_and_as_coarse_as_can_be() -> None:
    surfaces = {surface.name: surface for surface in mean_surfaces(room())}
    assert len(surfaces["wall"].cells) == 2
    assert len(surfaces["carton"].cells) == 12
    np.testing.assert_array_equal(surfaces["wall"].vertices, surfaces["wall"].mean_vertices)


def test_the_camera_sees_all_of_the_scenario() -> None:
    eye, target = (np.array(point) for point in stand_back(room()))
    away = np.array([1.0, 0.8, 0.0]) - eye
    towards = target - eye
    cosine = away @ towards / np.linalg.norm(away) / np.linalg.norm(towards)
    assert math.degrees(math.acos(cosine)) < 45.0
    assert eye[1] < 0.0  # behind the base station, which looks along +y
