from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sionna.rt as rt

from scenes.files.loading import load_scenario, scenario_schema, scenario_to_toml
from scenes.meshes.foreign_scene import with_geometry
from scenes.meshes.mesh_file import placed_mesh
from scenes.meshes.ply_writer import ply_bytes
from scenes.realisations.object_surface import object_surface
from scenes.realisations.surface_mesh import surface_to_mesh
from scenes.scenario import Scenario, ScenarioError, parse_scenario
from scenes.schema.materials import Slab
from scenes.schema.objects import MeshFile
from scenes.surfaces.mesh_section_2d import lines_are_closed, mesh_lines, mesh_segments

RADIO = {"start_ghz": 2.0, "stop_ghz": 3.0, "points": 11}
STATION = {"elements": 3, "spacing_mm": 0.5}


def scenario(geometry: dict[str, Any], **more: Any) -> Scenario:
    return parse_scenario(
        {"name": "foreign", "dimensions": 3, "radio": RADIO, "base_station": STATION}
        | {"geometry": geometry}
        | more
    )


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A box 2 m wide (mesh-box, from -1 to 1 in x, 1 to 2 in y) and a plate, at z = 0."""
    box = parse_scenario(
        {
            "name": "box", "dimensions": 3, "radio": RADIO, "base_station": STATION,
            "objects": {
                "box": {
                    "kind": "box", "material": "metal", "centre_m": [0.0, 1.5, 0.1],
                    "length_m": 2.0, "depth_m": 1.0, "height_m": 1.0,
                }
            },
        }
    )  # fmt: skip
    mesh = surface_to_mesh(object_surface(box, "box", seed=0, spacing=np.inf), extrude=None)
    (tmp_path / "box.ply").write_bytes(ply_bytes(mesh.vertices, mesh.faces))
    plate = np.array([[-2.0, 3, -1], [2, 3, -1], [2, 3, 1], [-2, 3, 1]])
    (tmp_path / "plate.ply").write_bytes(ply_bytes(plate, np.array([[0, 1, 2], [0, 2, 3]])))
    path = tmp_path / "room.xml"
    path.write_text(
        '<scene version="3.0.0"><bsdf type="diffuse" id="mat-paint"/>'
        '<bsdf type="itu-radio-material" id="board"><string name="type" value="wood"/></bsdf>'
        '<shape type="ply" id="mesh-box"><string name="filename" value="box.ply"/>'
        '<ref id="mat-paint" name="bsdf"/></shape>'
        '<shape type="ply" id="mesh-plate"><string name="filename" value="plate.ply"/>'
        '<transform name="to_world"><translate y="0.5"/></transform>'
        '<ref id="board" name="bsdf"/></shape></scene>'
    )
    return path


PAINTED = {"paint": {"material": "drywall", "roughness": {"rms_mm": 0.0, "correlation_mm": 1.0}}}


def test_beyond_itu_holds_for_all_materials_of_the_file(room: Path) -> None:
    geometry = {"file": str(room), "beyond_itu": True}
    found = scenario(geometry | {"materials": {"paint": {"material": "metal"}}})
    assert found.objects["plate"].material == Slab.model_validate(
        {"name": "wood", "thickness_mm": 100.0, "beyond_itu": True}
    )
    unnamed = {"permittivity": [2.0, 0.0], "thickness_mm": 1.0, "beyond_itu": True}
    with pytest.raises(ScenarioError, match="beyond_itu = true is about named materials"):
        scenario({"file": str(room), "materials": {"paint": {"material": unnamed}}})


def test_a_foreign_scenes_shapes_become_objects(room: Path) -> None:
    found = scenario({"file": str(room), "materials": PAINTED})
    assert list(found.objects) == ["box", "plate"]
    box, plate = found.objects["box"], found.objects["plate"]
    board = Slab.model_validate({"name": "wood", "thickness_mm": 100.0})  # Sionna's own default
    assert (box.material, plate.material) == ("drywall", board)
    assert isinstance(plate, MeshFile)
    np.testing.assert_allclose(placed_mesh(plate).bounds, [[-2, 3.5, -1], [2, 3.5, 1]])


def test_a_shape_of_its_own_material_goes_before_its_materials(room: Path) -> None:
    own = {"material": {"permittivity": [3.0, 0.1], "thickness_mm": 5.0}}
    found = scenario({"file": str(room), "materials": PAINTED, "objects": {"plate": own}})
    assert found.objects["plate"].material == Slab(permittivity=(3.0, 0.1), thickness_mm=5.0)
    assert found.objects["box"].material == "drywall"


def test_a_rough_foreign_face_is_as_rough_as_asked(tmp_path: Path) -> None:
    plate = np.array(
        [[-0.05, 0.5, -0.02], [0.05, 0.5, -0.02], [0.05, 0.5, 0.02], [-0.05, 0.5, 0.02]]
    )
    (tmp_path / "plate.ply").write_bytes(ply_bytes(plate, np.array([[0, 1, 2], [0, 2, 3]])))
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.0.0"><shape type="ply" id="wall"><string name="filename" '
        'value="plate.ply"/></shape></scene>'
    )
    wall = {"material": "metal", "roughness": {"rms_mm": 0.1, "correlation_mm": 2.0}}
    found = scenario({"file": str(path), "objects": {"wall": wall}})
    surface = object_surface(found, "wall", seed=0)
    heights = (surface.vertices - surface.mean_vertices)[:, 1]
    # 50 x 20 correlation lengths: about 300 independent patches of π l²
    assert heights.std() == pytest.approx(0.1e-3, rel=4 / np.sqrt(2 * 300))


def test_a_scene_of_sionnas_is_found_by_its_name() -> None:
    station = STATION | {"position_m": [0.0, 0.0, 2.0]}
    inside = {"box": {"hollow": True}}
    named = scenario({"sionna": "box_two_screens", "objects": inside}, base_station=station)
    whole = {"file": rt.scene.box_two_screens, "objects": inside}
    assert named.objects == scenario(whole, base_station=station).objects


def test_a_name_that_no_scene_has_is_refused_with_those_known() -> None:
    told = r"'boxx': no scene of Sionna RT \(did you mean 'box'\?\); known: .*munich"
    with pytest.raises(ScenarioError, match=told):
        scenario({"sionna": "boxx"})
    with pytest.raises(ScenarioError, match="has both file and sionna; give exactly one"):
        scenario({"sionna": "box", "file": "box.xml"})


def test_a_radio_material_of_a_file_is_a_slab_that_conducts(tmp_path: Path) -> None:
    plate = np.array([[-0.1, 0.5, -0.1], [0.1, 0.5, -0.1], [0.1, 0.5, 0.1], [-0.1, 0.5, 0.1]])
    (tmp_path / "plate.ply").write_bytes(ply_bytes(plate, np.array([[0, 1, 2], [0, 2, 3]])))
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.0.0"><bsdf type="radio-material" id="soil"><float '
        'name="relative_permittivity" value="2.1"/><float name="conductivity" value="0.01"/>'
        '<float name="thickness" value="0.05"/></bsdf><shape type="ply" id="wall"><string '
        'name="filename" value="plate.ply"/><ref id="soil"/></shape></scene>'
    )
    made = scenario({"file": str(path)}).objects["wall"].material
    assert made == Slab(permittivity=(2.1, 0.0), conductivity_s_m=0.01, thickness_mm=50.0)


def test_sionnas_own_scene_is_a_scenario() -> None:
    station = STATION | {"position_m": [0.0, 0.0, 2.0]}
    geometry = {"file": rt.scene.box_two_screens}
    found = scenario(geometry, base_station=station)
    assert set(found.objects) == {"box", "screen_1", "screen_2"}
    box = found.objects["box"]
    assert isinstance(box, MeshFile)
    assert box.hollow  # a closed room with the array inside
    assert box.material == "metal"
    assert found.objects["screen_1"].material == Slab(name="glass", thickness_mm=10.0)
    assert not object_surface(found, "box", seed=0, spacing=np.inf).closed


def test_a_foreign_scenario_is_written_and_read_as_the_same(room: Path, tmp_path: Path) -> None:
    found = scenario({"file": str(room), "materials": PAINTED})
    (tmp_path / "again.toml").write_text(scenario_to_toml(found))
    assert load_scenario(str(tmp_path / "again.toml")) == found


def test_the_scenes_file_is_relative_to_the_scenarios(room: Path) -> None:
    (room.parent / "mine.toml").write_text(
        "dimensions = 3\nradio = {start_ghz = 2.0, stop_ghz = 3.0, points = 11}\n"
        'base_station = {elements = 3, spacing_mm = 0.5}\n[geometry]\nfile = "room.xml"\n'
        '[geometry.materials.paint]\nmaterial = "metal"\n'
    )
    found = load_scenario(str(room.parent / "mine.toml"))
    assert found.objects["box"].material == "metal"
    slab = "geometry.materials.board.material={name='wood', thickness_mm=3.0}"
    found = load_scenario(str(room.parent / "mine.toml"), [slab])
    assert found.objects["plate"].material == Slab(name="wood", thickness_mm=3.0)


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ({}, r"^geometry: has neither file and sionna; give exactly one"),
        ({"file": "nowhere.xml"}, r"^geometry\.file: scene file 'nowhere\.xml': No such file"),
        ({"flie": 1}, r"geometry\.flie: unknown key \(did you mean 'file'\?\)"),
        ({"facets": "some"}, r"geometry\.facets = 'some': must be 'cut' or 'file'"),
        ({"materials": {}}, r"^geometry\.materials\.paint\.material: missing \(for shape 'box'\)"),
        (
            {"materials": PAINTED | {"bord": {"material": "metal"}}},
            r"^geometry\.materials\.bord: no such name in .*did you mean 'board'\?\); known: ",
        ),
        (
            {"materials": PAINTED, "objects": {"plate": {"file": "/etc/passwd"}}},
            r"^geometry\.objects\.plate\.file: is decided by the file; remove it",
        ),
        (
            {"materials": {"paint": {"material": "paper"}}},
            r"^objects\.box\.material = 'paper': unknown material",
        ),
        (
            {"materials": {"paint": {"material": "metal", "roughness": {"rms_mm": 0.1,
             "correlation_mm": 1.0}}}, "facets": "file"},
            r"^objects\.box: facets = 'file' takes the surface as it is, and roughness",
        ),
    ],
)  # fmt: skip
def test_a_geometry_that_cannot_be_is_refused(
    room: Path, geometry: dict[str, Any], message: str
) -> None:
    whole = ({"file": str(room)} if geometry else {}) | geometry
    with pytest.raises(ScenarioError, match=message):
        scenario(whole)


def test_an_object_and_a_shape_must_not_share_their_name(room: Path) -> None:
    post = {"kind": "cylinder", "material": "metal", "centre_m": [0, 0.5], "radius_m": 0.1}
    with pytest.raises(ScenarioError, match=r"^objects\.box: a shape of geometry\.file has this"):
        scenario({"file": str(room), "materials": PAINTED}, objects={"box": post})


def test_a_shape_without_material_must_be_given_one(room: Path) -> None:
    room.write_text(room.read_text().replace('<ref id="board" name="bsdf"/>', ""))
    with pytest.raises(ScenarioError, match=r"^geometry\.objects\.plate\.material: missing, and"):
        scenario({"file": str(room), "materials": PAINTED})


def test_without_geometry_nothing_changes() -> None:
    assert with_geometry({"name": "a", "objects": {}}) == {"name": "a", "objects": {}}


def test_the_schema_knows_the_table() -> None:
    assert "file" in scenario_schema()["properties"]["geometry"]["properties"]


def test_in_two_dimensions_a_box_becomes_its_outline(room: Path) -> None:
    found = scenario({"file": str(room), "materials": PAINTED}, dimensions=2)
    surface = object_surface(found, "box", seed=0)
    assert surface.closed
    lines = surface.vertices[surface.cells]
    way = lines[:, 1] - lines[:, 0]
    lengths = np.linalg.norm(way, axis=-1)
    assert lengths.sum() == pytest.approx(6.0, rel=1e-12)
    assert lengths.max() <= found.facet_spacing("box") * (1 + 1e-12)
    # Outward is to the right of the way: away from the box' centre.
    outward = np.stack([way[:, 1], -way[:, 0]], axis=-1)
    offset = lines.mean(axis=1)[:, :2] - [0.0, 1.5]
    assert np.all(np.sum(outward * offset, axis=-1) > 0)
    plate = object_surface(found, "plate", seed=0)
    assert not plate.closed
    np.testing.assert_allclose(np.unique(plate.vertices[:, 1]), [3.5], atol=1e-15)


def test_what_does_not_stand_upright_in_two_dimensions_is_refused(room: Path) -> None:
    slope = np.array([[-2.0, 3, -1], [2, 3, -1], [2, 4, 1], [-2, 4, 1]])
    (room.parent / "plate.ply").write_bytes(ply_bytes(slope, np.array([[0, 1, 2], [0, 2, 3]])))
    with pytest.raises(ScenarioError, match=r"^objects\.plate\.file: .* is not upright"):
        scenario({"file": str(room), "materials": PAINTED}, dimensions=2)
    (room.parent / "plate.ply").write_bytes(
        ply_bytes(slope + np.array([0, 0, 1.5]), np.array([[0, 1, 2], [0, 2, 3]]))
    )
    with pytest.raises(ScenarioError, match=r"reaches from z = 0\.5 to 2\.5 m and does not cross"):
        scenario({"file": str(room), "materials": PAINTED}, dimensions=2)


def test_lines_of_a_mesh_are_not_made_rough(room: Path) -> None:
    from scenes.schema.roughness import Roughness
    from scenes.surfaces.heights import Heights

    found = scenario({"file": str(room), "materials": PAINTED}, dimensions=2)
    box = found.objects["box"]
    assert isinstance(box, MeshFile)
    heights = Heights(Roughness(rms_mm=0.1, correlation_mm=1.0), np.random.default_rng(0))
    with pytest.raises(ScenarioError, match="cannot be rough in two dimensions"):
        mesh_lines(box, 1e-3, heights)


def test_only_a_chain_that_returns_is_closed(room: Path) -> None:
    assert lines_are_closed(np.array([[0, 1], [1, 2], [2, 0]]))
    assert not lines_are_closed(np.array([[0, 1], [1, 2]]))
    found = scenario({"file": str(room), "materials": PAINTED}, dimensions=2)
    box = found.objects["box"]
    assert isinstance(box, MeshFile)
    starts, ends = mesh_segments(box)
    # Each of the four walls is two triangles, and so two pieces that meet on the diagonal.
    assert len(starts) == len(ends) == 8
