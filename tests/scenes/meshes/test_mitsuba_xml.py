import math
from pathlib import Path

import numpy as np
import pytest

from scenes.meshes import mitsuba_elements, mitsuba_xml
from scenes.meshes.mesh_file import placed_mesh
from scenes.meshes.mitsuba_xml import RadioSlab, read_mitsuba_xml
from scenes.meshes.ply_writer import ply_bytes
from scenes.schema.errors import ScenarioError
from scenes.schema.objects import MeshFile

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


def test_to_look_at_a_point_turns_as_mitsuba_turns(folder: Path) -> None:
    import mitsuba as mi

    from estimator.compute import engine

    mi.set_variant(engine.mitsuba_variant())
    origin, target, up = [0.3, -0.5, 1.0], [2.0, 1.0, 0.4], [0.1, 0.2, 1.0]
    step = " ".join(
        f'{name}="{", ".join(map(str, values))}"'
        for name, values in (("origin", origin), ("target", target), ("up", up))
    )
    look = f'<transform name="to_world"><lookat {step}/></transform>'
    (found,) = read_mitsuba_xml(scene(folder, shape(more=look)))
    expected = mi.ScalarTransform4f().look_at(origin=origin, target=target, up=up)
    np.testing.assert_allclose(found.to_world, np.array(expected.matrix)[:3], atol=1e-6)


def test_nine_numbers_are_a_linear_map(folder: Path) -> None:
    nine = '<transform name="to_world"><matrix value="0 -2 0 2 0 0 0 0 3"/></transform>'
    (found,) = read_mitsuba_xml(scene(folder, shape(more=nine)))
    np.testing.assert_array_equal(found.to_world @ [1, 1, 1, 1], [-2, 2, 3])


@pytest.mark.parametrize(("kind", "volume", "area"), [("cube", 8.0, 24.0), ("rectangle", 0.0, 4.0)])
def test_a_shape_without_a_file_is_that_of_mitsuba(
    folder: Path, kind: str, volume: float, area: float
) -> None:
    body = MATERIAL + f'<shape type="{kind}" id="it"><ref id="mat-paint"/></shape>'
    (found,) = read_mitsuba_xml(scene(folder, body))
    mesh = placed_mesh(
        MeshFile.model_validate({"kind": "mesh", "file": str(found.file), "material": "metal"})
    )
    assert mesh.area == pytest.approx(area)
    assert mesh.volume == pytest.approx(volume)
    np.testing.assert_allclose(np.abs(mesh.vertices[:, :2]), 1.0)


def test_before_version_two_parameters_were_written_in_camel_case(folder: Path) -> None:
    old = '<transform name="toWorld"><scale value="2"/></transform>'
    path = scene(folder, shape(more=old))
    path.write_text(path.read_text().replace("3.0.0", "0.6.0"))
    (found,) = read_mitsuba_xml(path)
    np.testing.assert_array_equal(found.to_world, 2 * np.eye(4)[:3])


def test_instances_put_a_group_in_several_places(folder: Path) -> None:
    twice = '<transform name="to_world"><scale value="2"/></transform>'
    group = (
        '<shape type="shapegroup" id="g">' + SHAPE.format(file="wall.ply", more=twice) + "</shape>"
    )
    places = "".join(
        f'<shape type="instance" id="i{x}"><ref id="g"/>'
        f'<transform name="to_world"><translate x="{x}"/></transform></shape>'
        for x in (1, 5)
    )
    found = read_mitsuba_xml(scene(folder, MATERIAL + group + places))
    assert [one.name for one in found] == ["i1", "i5"]
    for one, x in zip(found, (1, 5), strict=True):
        np.testing.assert_array_equal(one.to_world @ [1, 0, 0, 1], [2 + x, 0, 0])
        assert one.material.name == "paint"


def test_lights_in_shapes_are_passed_over(folder: Path) -> None:
    (found,) = read_mitsuba_xml(scene(folder, shape(more='<emitter type="area"/>')))
    assert found.name == "wall"


def test_meshes_are_looked_for_where_the_file_says(folder: Path) -> None:
    (folder / "inner").mkdir()
    (folder / "wall.ply").rename(folder / "inner" / "wall.ply")
    (found,) = read_mitsuba_xml(scene(folder, '<path value="inner"/>' + shape()))
    assert found.file == folder / "inner" / "wall.ply"


def test_a_parameter_has_the_value_that_the_file_gives_it(folder: Path) -> None:
    body = '<default name="file" value="wall.ply"/>' + shape("$file")
    (found,) = read_mitsuba_xml(scene(folder, body))
    assert found.file == folder / "wall.ply"


@pytest.mark.parametrize("two_sided", [False, True])
def test_a_radio_material_brings_its_numbers(folder: Path, two_sided: bool) -> None:
    numbers = (
        '<float name="relative_permittivity" value="2.5"/><float name="conductivity" value="0.02"/>'
    )
    material = f'<bsdf type="radio-material" id="mat-paint">{numbers}</bsdf>'
    if two_sided:
        inner = material.replace(' id="mat-paint"', "")
        material = f'<bsdf type="twosided" id="mat-paint">{inner}</bsdf>'
    (found,) = read_mitsuba_xml(scene(folder, material + SHAPE.format(file="wall.ply", more="")))
    assert found.material.slab == RadioSlab(permittivity=2.5, conductivity=0.02, thickness=0.1)


def test_long_names_are_shortened_and_stay_apart(folder: Path) -> None:
    street = "Strasse_" * 10
    both = "".join(
        SHAPE.format(file="wall.ply", more="").replace("mesh-wall", f"mesh-{street}{end}")
        for end in ("north", "south")
    )
    names = [found.name for found in read_mitsuba_xml(scene(folder, MATERIAL + both))]
    assert [len(name) for name in names] == [64, 64]
    assert names[0] != names[1]
    assert all(name.startswith("Strasse_Strasse_") for name in names)


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
        ('<path value="/etc"/>', "lies outside of the file's own folder"),
        ('<alias id="a" as="b"/>', "<alias> is not allowed"),
        ('<shape type="disk"/>', "<shape type='disk'> is not known"),
        ('<shape type="instance"><ref id="g"/></shape>', "refers to the group 'g'"),
        (
            shape(more='<transform name="toWorld"><scale value="2"/></transform>'),
            "since version 2.0.0 it is called 'to_world'",
        ),
        ('<shape type="plyy"/>', "did you mean 'ply'?"),
        ('<bsdf type="my-plugin" id="m"/>', "<bsdf type='my-plugin'> is not known"),
        (shape(more='<bsdf type="evil"/>'), "<bsdf type='evil'> is not known"),
        (shape(more='<include filename="x"/>'), "<include> is not allowed in <shape>"),
        (shape().replace('id="mat-paint" name', 'id="mat-pain" name'), "did you mean 'mat-paint'?"),
        (shape() + SHAPE.format(file="wall.ply", more=""), "two shapes are called 'wall'"),
        (MATERIAL, "it holds no shape"),
        ('<shape type="ply"/>', "lacks its 'filename'"),
        (
            shape(more='<transform name="to_world"><shear/></transform>'),
            "<shear> in a transform",
        ),
        (
            shape(
                more='<transform name="to_world"><lookat origin="0 0 0" target="0 0 1" up="0 0 2"/>'
                "</transform>"
            ),
            "looks along its 'up'",
        ),
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
    assert "more than 0 shapes" in refusal(scene(folder, shape()))
    monkeypatch.setattr(mitsuba_elements, "LARGEST_FILE", 10)
    assert "a file of 1 to 10 bytes is needed" in refusal(path)
