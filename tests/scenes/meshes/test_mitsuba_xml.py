import math
from pathlib import Path

import numpy as np
import pytest

from scenes.meshes import mitsuba_xml
from scenes.meshes.mitsuba_xml import read_mitsuba_xml
from scenes.meshes.ply_writer import ply_bytes
from scenes.schema.errors import ScenarioError

MATERIAL = '<bsdf type="diffuse" id="mat-paint"/>'
SHAPE = (
    '<shape type="ply" id="mesh-wall"><string name="filename" value="{file}"/>{more}'
    '<ref id="mat-paint" name="bsdf"/></shape>'
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    inside = tmp_path / "scene"
    inside.mkdir()
    triangle = ply_bytes(np.eye(3), np.array([[0, 1, 2]]))
    (inside / "wall.ply").write_bytes(triangle)
    (tmp_path / "outside.ply").write_bytes(triangle)
    return inside


def scene(folder: Path, body: str) -> Path:
    path = folder / "scene.xml"
    path.write_text(f'<scene version="3.0.0">{body}</scene>')
    return path


def shape(file: str = "wall.ply", more: str = "") -> str:
    return MATERIAL + SHAPE.format(file=file, more=more)


def refusal(path: Path) -> str:
    with pytest.raises(ScenarioError) as error:
        read_mitsuba_xml(path)
    return str(error.value)


def test_a_shape_has_its_mesh_material_and_place(folder: Path) -> None:
    (found,) = read_mitsuba_xml(scene(folder, shape()))
    assert (found.name, found.file) == ("wall", folder / "wall.ply")
    assert (found.material.name, found.material.itu_type) == ("paint", None)
    np.testing.assert_array_equal(found.to_world, np.eye(4)[:3])


@pytest.mark.parametrize(
    "material",
    [
        '<bsdf type="itu-radio-material" id="x"><string name="type" value="glass"/>'
        '<float name="thickness" value="0.01"/></bsdf>',
        '<bsdf type="twosided" id="mat-itu_glass"><bsdf type="diffuse"/>'
        '<float name="thickness" value="0.01"/></bsdf>',
    ],
    ids=["Sionna 1 and later", "Sionna 0 and Blender"],
)
def test_an_itu_material_is_known_by_its_type(folder: Path, material: str) -> None:
    body = material + SHAPE.format(file="wall.ply", more="").replace(
        "mat-paint", "x" if 'id="x"' in material else "mat-itu_glass"
    )
    (found,) = read_mitsuba_xml(scene(folder, body))
    assert (found.material.itu_type, found.material.thickness) == ("glass", 0.01)


def test_the_steps_of_a_transform_act_one_after_the_other(folder: Path) -> None:
    steps = (
        '<transform name="to_world"><scale value="2"/><rotate z="1" angle="90"/>'
        '<translate x="1" z="-3"/></transform>'
    )
    (found,) = read_mitsuba_xml(scene(folder, shape(more=steps)))
    # (1, 0, 0) -> (2, 0, 0) -> (0, 2, 0) -> (1, 2, -3)
    np.testing.assert_allclose(found.to_world @ [1, 0, 0, 1], [1, 2, -3], atol=1e-15)
    matrix = " ".join(str(value) for value in np.vstack([found.to_world, [0, 0, 0, 1]]).ravel())
    whole = f'<transform name="to_world"><matrix value="{matrix}"/></transform>'
    (again,) = read_mitsuba_xml(scene(folder, shape(more=whole)))
    np.testing.assert_array_equal(again.to_world, found.to_world)


def test_a_rotation_about_any_axis_keeps_lengths_and_the_axis(folder: Path) -> None:
    turn = '<transform name="to_world"><rotate value="1 2 2" angle="77"/></transform>'
    (found,) = read_mitsuba_xml(scene(folder, shape(more=turn)))
    rotation = found.to_world[:, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(rotation @ [1, 2, 2], [1, 2, 2], atol=1e-14)
    assert np.trace(rotation) == pytest.approx(1 + 2 * math.cos(math.radians(77)))


def test_names_become_keys_of_a_scenario(folder: Path) -> None:
    (found,) = read_mitsuba_xml(scene(folder, shape().replace("mesh-wall", "mesh-Cube.001")))
    assert found.name == "Cube_001"


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("../outside.ply", "lies outside of the file's own folder"),
        ("/etc/hostname.ply", "lies outside of the file's own folder"),
        ("link.ply", "lies outside of the file's own folder"),
        ("/etc/passwd", "only PLY and OBJ files are read"),
        ("wall.serialized", "only PLY and OBJ files are read"),
        ("$mesh", r"parameters (\$) are not filled in".replace("\\", "")),
    ],
)
def test_no_file_outside_of_the_scenes_folder_is_read(
    folder: Path, file: str, message: str
) -> None:
    (folder / "link.ply").symlink_to(folder.parent / "outside.ply")
    assert message in refusal(scene(folder, shape(file)))


def test_entities_are_not_expanded(folder: Path) -> None:
    path = folder / "scene.xml"
    secret = folder.parent / "secret"
    secret.write_text("wall.ply")
    for declaration in (
        f'<!DOCTYPE scene [<!ENTITY e SYSTEM "{secret}">]>',
        '<!DOCTYPE scene [<!ENTITY e "wall.ply">]>',
        f'<!DOCTYPE scene SYSTEM "{secret}">',
    ):
        path.write_text(declaration + f'<scene version="3.0.0">{shape("&e;")}</scene>')
        assert "declares a document type ('scene')" in refusal(path)
    path.write_text(f'<scene version="3.0.0">{shape("&e;")}</scene>')
    assert "undefined entity" in refusal(path)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('<include filename="other.xml"/>', "<include> is not allowed"),
        ('<path value="/etc"/>', "<path> is not allowed"),
        ('<alias id="a" as="b"/>', "<alias> is not allowed"),
        ('<shape type="rectangle"/>', "<shape type='rectangle'> is not known"),
        ('<shape type="plyy"/>', "did you mean 'ply'?"),
        ('<bsdf type="my-plugin" id="m"/>', "<bsdf type='my-plugin'> is not known"),
        (shape(more='<bsdf type="evil"/>'), "<bsdf type='evil'> is not known"),
        (shape(more='<emitter type="area"/>'), "<emitter> is not allowed in <shape>"),
        (shape().replace('id="mat-paint" name', 'id="mat-pain" name'), "did you mean 'mat-paint'?"),
        (shape() + SHAPE.format(file="wall.ply", more=""), "two shapes are called 'wall'"),
        (MATERIAL, "it holds no shape"),
        ('<shape type="ply"/>', "lacks its 'filename'"),
        (shape(more='<transform name="to_world"><lookat/></transform>'), "<lookat> in a transform"),
        (
            shape(more='<transform name="to_world"><rotate angle="5"/></transform>'),
            "a <rotate> has no axis",
        ),
        (
            shape(more='<transform name="to_world"><matrix value="1 2"/></transform>'),
            "16 finite numbers are needed",
        ),
        (
            shape(more='<transform name="to_world"><translate x="nan"/></transform>'),
            "1 finite numbers are needed",
        ),
        (
            shape(
                more='<transform name="to_world"><matrix value="' + "1 " * 16 + '"/></transform>'
            ),
            "must be 0 0 0 1",
        ),
    ],
)
def test_what_is_not_known_is_refused(folder: Path, body: str, message: str) -> None:
    assert message in refusal(scene(folder, body))


def test_a_file_that_is_no_scene_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder / "scene.xml"
    assert "give the path of a Mitsuba XML file" in refusal(path)
    path.write_text("")
    assert "is it XML?" in refusal(path)
    path.write_text("<scene>")
    assert "not valid XML" in refusal(path)
    path.write_text("<html/>")
    assert "its root is <html>" in refusal(path)
    path.write_text("<scene>" + "<default>" * 40 + "</default>" * 40 + "</scene>")
    assert "nested deeper than 32" in refusal(path)
    monkeypatch.setattr(mitsuba_xml, "MOST_SHAPES", 0)
    assert "1 shapes are more than 0" in refusal(scene(folder, shape()))
    monkeypatch.setattr(mitsuba_xml, "LARGEST_FILE", 10)
    assert "a file of 1 to 10 bytes is needed" in refusal(path)
