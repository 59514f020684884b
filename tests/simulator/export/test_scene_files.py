from collections.abc import Callable
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
import sionna.rt as rt

from scenes.files.loading import load_scenario
from scenes.meshes.ply_writer import ply_bytes
from scenes.realisations.object_surface import object_surface
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from simulator.export.scene_files import MOST_FROZEN, exported_files, frozen_facets
from simulator.geometry.mean_surfaces import mean_surfaces
from simulator.geometry.ray_scene import build_scene, facets_visible
from simulator.materials.sionna_materials import scattering_coefficient
from simulator.scene.radio_scene import radio_scene
from simulator.simulation import simulate


def exported(scenario: Scenario, folder: Path, *, seed: int = 0) -> None:
    for name, content in exported_files(scenario, seed=seed):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def small_slam_2d() -> Scenario:
    return load_scenario("slam_2d", ["radio.points=21", "base_station.elements=5"])


def solid() -> Scenario:
    """In 3-D, with a plate, a box and a cylinder, all rough."""
    rough = {"rms_mm": 0.1, "correlation_mm": 2.0}
    return parse_scenario(
        {
            "name": "solid", "dimensions": 3, "max_bounces": 2,
            "radio": {"start_ghz": 20.0, "stop_ghz": 30.0, "points": 5},
            "base_station": {"elements": [2, 2], "spacing_mm": 5.0},
            "objects": {
                "wall": {
                    "kind": "plate", "material": "metal", "centre_m": [0.0, 0.4],
                    "angle_deg": 30.0, "length_m": 0.04, "height_m": 0.03, "roughness": rough,
                },
                "box": {
                    "kind": "box", "material": "metal", "centre_m": [0.1, 0.4],
                    "angle_deg": 10.0, "length_m": 0.03, "depth_m": 0.02, "height_m": 0.04,
                    "roughness": rough,
                },
                "post": {
                    "kind": "cylinder", "material": "metal", "centre_m": [-0.1, 0.4],
                    "radius_m": 0.02, "height_m": 0.03, "roughness": rough,
                },
            },
            "users": {"user": {"position_m": [0.1, 0.2, 0.01]}},
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("make", "correlation", "level_db"), [(small_slam_2d, 0.97, 4.0), (solid, 0.999, 0.1)]
)
def test_an_exported_scene_is_the_same_surface_without_its_mean(
    make: Callable[[], Scenario], correlation: float, level_db: float, tmp_path: Path
) -> None:
    scenario = make()
    exported(scenario, tmp_path, seed=3)
    again = load_scenario(str(tmp_path / f"{scenario.name}_facets.toml"))
    ours, theirs = (radio_scene(scene, seed=3, sample=0) for scene in (scenario, again))
    assert ours.facets is not None
    assert theirs.facets is not None
    # A rough line's facets stand on its mean, not between vertices: height times slope apart.
    np.testing.assert_allclose(theirs.facets.centres, ours.facets.centres, rtol=0, atol=3e-6)
    np.testing.assert_array_equal(theirs.facets.two_sided, ours.facets.two_sided)
    points = scenario.base_station.element_positions
    seen = [facets_visible(one.rays, one.facets, points) for one in (ours, theirs)]  # type: ignore[arg-type]
    assert np.mean(seen[0] != seen[1]) < 0.02  # rays meet the mean surface of the one only
    # Facets whose mean is not known scatter as tangent planes: a short-waved line at 45° is then
    # 3.8 dB brighter (Bragg), bodies in space hardly differ.
    first, second = (simulate(scene, seed=3).measurement for scene in (scenario, again))
    assert first.echo is not None
    assert second.echo is not None
    pairs = [(first.echo.samples, second.echo.samples)]
    pairs += [
        (one.samples, other.samples)
        for one, other in zip(first.uplinks, second.uplinks, strict=True)
    ]
    for one, other in pairs:
        sizes = np.linalg.norm(one), np.linalg.norm(other)
        assert abs(np.vdot(one, other)) >= correlation * sizes[0] * sizes[1]
        assert abs(20 * np.log10(sizes[1] / sizes[0])) <= level_db


def test_sionna_opens_the_smooth_scene_with_its_radio_materials(tmp_path: Path) -> None:
    scenario = small_slam_2d()
    exported(scenario, tmp_path)
    scene = rt.load_scene(str(tmp_path / "slam_2d.xml"), merge_shapes=False)
    wall = scene.objects["wall"]
    assert wall.mi_mesh.face_count() == 2
    material = wall.radio_material
    assert material.conductivity[0] == pytest.approx(1e7)
    assert material.scattering_coefficient[0] == pytest.approx(
        scattering_coefficient(0.05e-3, 257.5e9), rel=1e-6
    )


def test_mitsuba_reads_the_facets_to_single_precision(tmp_path: Path) -> None:
    scenario = solid()
    exported(scenario, tmp_path)
    ours = build_scene([object_surface(scenario, "post", seed=0)])
    scene = rt.load_scene(str(tmp_path / "solid_facets.xml"), merge_shapes=False)
    theirs = scene.objects["post"].mi_mesh
    mesh, centre = ours.objects["post"].mi_mesh, ours.centre
    # Ours are about the scene's centre: rounding once there and once in the world's coordinates.
    np.testing.assert_allclose(
        mi.traverse(theirs)["vertex_positions"].numpy().reshape(-1, 3),
        mi.traverse(mesh)["vertex_positions"].numpy().reshape(-1, 3) + centre,
        rtol=0,
        atol=2 * float(np.finfo(np.float32).eps),
    )
    assert scene.objects["post"].radio_material.scattering_coefficient[0] == 0.0


def test_the_same_seed_gives_the_same_bytes_and_another_one_another_wall() -> None:
    files = [dict(exported_files(small_slam_2d(), seed=seed)) for seed in (0, 0, 1)]
    assert files[0] == files[1]
    changed = [name for name in files[0] if files[0][name] != files[2][name]]
    assert changed == ["slam_2d_facets_meshes/wall.ply"]


def test_a_scenario_of_an_exported_scene_is_exported_again(tmp_path: Path) -> None:
    exported(solid(), tmp_path)
    again = load_scenario(str(tmp_path / "solid_facets.toml"))
    names = [name for name, _ in exported_files(again)]
    assert "solid_facets_facets_meshes/post.ply" in names


def test_a_scenario_without_objects_is_exported_too(tmp_path: Path) -> None:
    empty = load_scenario("slam_2d").model_copy(update={"objects": {}, "users": {}})
    exported(empty, tmp_path)
    assert load_scenario(str(tmp_path / "slam_2d_facets.toml")).objects == {}


def test_a_realisation_of_too_many_facets_is_left_out_of_the_export() -> None:
    scenario = load_scenario("room_3d")
    assert frozen_facets(scenario) > MOST_FROZEN
    names = [name for name, _ in exported_files(scenario)]
    assert "room_3d.xml" in names
    assert not any("facets" in name for name in names)


def test_a_realisation_must_lie_where_its_object_is(tmp_path: Path) -> None:
    scenario = small_slam_2d()
    exported(scenario, tmp_path)
    file = str(tmp_path / "slam_2d_facets.toml")
    with pytest.raises(ScenarioError, match=r"objects\.wall\.realisation: the extents of .* off"):
        load_scenario(file, ["objects.wall.angle_deg=46"])
    with pytest.raises(ScenarioError, match=r"objects\.wall\.realisation: .* No such file"):
        load_scenario(file, ["objects.wall.realisation=none.ply"])


def test_a_frozen_realisation_is_the_same_for_every_seed(tmp_path: Path) -> None:
    exported(small_slam_2d(), tmp_path, seed=3)
    again = load_scenario(str(tmp_path / "slam_2d_facets.toml"))
    one, other = (radio_scene(again, seed=seed, sample=0).facets for seed in (0, 1))
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.centres, other.centres)


def test_where_antennas_stand_apart_a_plate_takes_no_realisation(tmp_path: Path) -> None:
    file = tmp_path / "sample.ply"
    sample = mean_surfaces(load_scenario("rcs_drywall"))[0]
    file.write_bytes(ply_bytes(sample.vertices, sample.cells))
    with pytest.raises(ScenarioError, match=r"realisation: the heights of plates are drawn tile"):
        load_scenario("rcs_drywall", [f"objects.sample.realisation={file}"])
