import math
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from scenes.meshes.mesh_file import mesh_contains, mesh_distance, placed_mesh
from scenes.realisations.object_surface import Surface, object_surface
from scenes.scenario import MeshFile, Scenario, ScenarioError, parse_scenario
from scenes.surfaces.mesh_refinement import refined

Table = dict[str, Any]


def saved(folder: Path, mesh: trimesh.Trimesh, name: str = "it.ply") -> str:
    path = folder / name
    mesh.export(path)
    return str(path)


def cube(side: float = 0.1) -> trimesh.Trimesh:
    made: trimesh.Trimesh = trimesh.creation.box(extents=(side, side, side))
    return made


def mesh_table(file: str, **changes: object) -> Table:
    return {"kind": "mesh", "material": "metal", "file": file, "centre_m": [0, 0.5, 0], **changes}


def scene(body: Table, **others: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "scene",
            "dimensions": 3,
            "radio": {"start_ghz": 57.0, "stop_ghz": 60.0, "points": 11},
            "base_station": {"elements": [8, 4], "spacing_mm": 2.0},
            "objects": {"it": body, **others.pop("objects", {})},
            **others,
        }
    )


def refused(message: str, body: Table, **others: Any) -> None:
    start = time.perf_counter()
    with pytest.raises(ScenarioError, match=message):
        scene(body, **others)
    assert time.perf_counter() - start < 1.0


def body_of(table: Table) -> MeshFile:
    body = scene(table).objects["it"]
    assert isinstance(body, MeshFile)
    return body


def as_mesh(made: Surface, vertices: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, made.cells, process=False)


# ---- reading and placing


@pytest.mark.parametrize("kind", ["ply", "stl", "obj", "off"])
def test_a_mesh_of_every_format_is_closed_and_has_its_volume(tmp_path: Path, kind: str) -> None:
    file = saved(tmp_path, cube(), f"it.{kind}")
    made = object_surface(scene(mesh_table(file)), "it", seed=0, spacing=math.inf)
    assert made.closed
    assert len(made.cells) == 12
    # Formats store single precision or 8 digits: 1e-7.
    assert as_mesh(made, made.vertices).volume == pytest.approx(1e-3, rel=1e-6)


def test_a_mesh_is_scaled_turned_and_moved(tmp_path: Path) -> None:
    brick = trimesh.creation.box(bounds=np.array([[0, 0, 0], [300, 100, 50]]))  # in millimetres
    table = mesh_table(saved(tmp_path, brick), scale=1e-3, angle_deg=90.0, centre_m=[1.0, 2.0, 3.0])
    bounds = placed_mesh(body_of(table)).bounds
    expected = [[0.9, 2.0, 3.0], [1.0, 2.3, 3.05]]
    np.testing.assert_allclose(bounds, expected, atol=1e-6)  # the file's single precision


def test_an_antenna_aimed_at_a_mesh_looks_at_the_middle_of_its_box(tmp_path: Path) -> None:
    brick = trimesh.creation.box(bounds=np.array([[0, 0, 0], [0.2, 0.2, 0.2]]))
    scenario = scene(
        mesh_table(saved(tmp_path, brick), centre_m=[1.0, 1.0, 0.0]),
        users={
            "ann": {
                "position_m": [1.1, 0.1, 0.1],
                "antenna": {"kind": "horn", "gain_dbi": 20, "aim": "it"},
            }
        },
    )
    user = scenario.users["ann"]
    np.testing.assert_allclose(scenario.object_centre("it"), [1.1, 1.1, 0.1], atol=1e-7)
    np.testing.assert_allclose(scenario.aim(user.antenna, user.position), [0, 1, 0], atol=1e-6)


def test_a_mesh_turned_inside_out_is_turned_back(tmp_path: Path) -> None:
    inverted = cube()
    inverted.invert()
    made = object_surface(scene(mesh_table(saved(tmp_path, inverted))), "it", seed=0)
    assert as_mesh(made, made.vertices).volume == pytest.approx(1e-3, rel=1e-6)


def test_an_open_mesh_is_seen_from_both_sides(tmp_path: Path) -> None:
    mesh = cube()
    mesh.update_faces(np.arange(len(mesh.faces)) > 1)
    scenario = scene(mesh_table(saved(tmp_path, mesh)))
    assert not object_surface(scenario, "it", seed=0).closed


def test_a_file_that_changed_is_read_again(tmp_path: Path) -> None:
    table = mesh_table(saved(tmp_path, cube()))
    assert placed_mesh(body_of(table)).volume == pytest.approx(1e-3, rel=1e-6)
    file = saved(tmp_path, cube(0.2))
    os.utime(file, ns=(0, 0))
    assert placed_mesh(body_of(table)).volume == pytest.approx(8e-3, rel=1e-6)


# ---- cutting


def test_a_cut_mesh_keeps_its_shape_and_has_short_edges(tmp_path: Path) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=1, radius=0.05)
    scenario = scene(mesh_table(saved(tmp_path, sphere)))
    spacing = scenario.facet_spacing("it")
    made = object_surface(scenario, "it", seed=0)
    mesh = as_mesh(made, made.vertices)
    assert mesh.edges_unique_length.max() <= spacing
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.area == pytest.approx(sphere.area, rel=1e-6)
    assert mesh.volume == pytest.approx(sphere.volume, rel=1e-6)


@pytest.mark.parametrize("longest", [0.9, 0.6, 0.31, 0.1])
def test_cut_triangles_keep_their_label_and_their_orientation(longest: float) -> None:
    rng = np.random.default_rng(5)
    vertices = np.concatenate([rng.random((12, 2)), np.zeros((12, 1))], axis=1)
    corners = np.sort(rng.permutation(12).reshape(4, 3), axis=1)
    x, y, z = np.moveaxis(vertices[corners], 1, 0)
    downward = np.cross(y - x, z - x)[:, 2] < 0
    corners[downward] = corners[downward][:, ::-1]
    points, faces, labels = refined(vertices, corners, np.arange(4), longest)

    def areas(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
        a, b, c = np.moveaxis(points[faces], 1, 0)
        across: np.ndarray = np.cross(b - a, c - a)[:, 2] / 2
        return across

    pieces = areas(points, faces)
    assert (pieces > 0).all()
    np.testing.assert_allclose(
        np.bincount(labels, weights=pieces), areas(vertices, corners), rtol=1e-12
    )


# ---- roughness

ROUGH = {"rms_mm": 0.2, "correlation_mm": 4.0}


def test_faces_of_a_rough_mesh_have_the_heights_asked_for(tmp_path: Path) -> None:
    table = mesh_table(saved(tmp_path, cube(0.04)), roughness=ROUGH)
    squares = []
    for seed in range(8):
        made = object_surface(scene(table), "it", seed=seed)
        assert as_mesh(made, made.vertices).is_watertight
        shift = made.vertices - made.mean_vertices
        local = made.mean_vertices - [0, 0.5, 0]
        for axis in range(3):
            for side in (-0.02, 0.02):
                face = np.abs(local[:, axis] - side) < 1e-6
                inner = face & ((np.abs(local) > 0.01999).sum(axis=-1) == 1)
                np.testing.assert_allclose(np.delete(shift[inner], axis, axis=1), 0, atol=1e-9)
                squares.append(np.mean(shift[inner, axis] ** 2))
    values = np.array(squares)
    error = values.std(ddof=1) / math.sqrt(len(values))
    assert abs(values.mean() - 0.2e-3**2) < 4.5 * error


def test_the_corner_of_a_rough_mesh_lies_on_all_its_faces(tmp_path: Path) -> None:
    made = object_surface(
        scene(mesh_table(saved(tmp_path, cube(0.04)), roughness=ROUGH)), "it", seed=0
    )
    local = made.mean_vertices - [0, 0.5, 0]
    shift = made.vertices - made.mean_vertices
    corners = (np.abs(local) > 0.01999).all(axis=-1)
    assert corners.sum() == 8
    # Three independent heights: every component is moved, none is an average of two.
    assert (np.abs(shift[corners]) > 0).all()
    assert 0.5e-3 > np.sqrt(np.mean(shift[corners] ** 2)) > 0.1e-3  # 24 draws of 0.2 mm


def test_nearly_parallel_faces_move_as_one(tmp_path: Path) -> None:
    # A roof with an edge of 10°: least squares alone would throw it up by h/sin(5°) sideways.
    low, rise = 0.05, 0.05 * math.tan(math.radians(5))
    vertices = np.array(
        [[-low, 0, 0], [0, 0, rise], [low, 0, 0], [-low, 0.1, 0], [0, 0.1, rise], [low, 0.1, 0]]
    )
    faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]
    roof = trimesh.Trimesh(vertices, faces, process=False)
    table = mesh_table(saved(tmp_path, roof), roughness=ROUGH)
    made = object_surface(scene(table), "it", seed=0)
    shift = np.linalg.norm(made.vertices - made.mean_vertices, axis=-1)
    assert shift.max() < 6 * 0.2e-3


def test_a_mesh_of_small_faces_cannot_be_rough(tmp_path: Path) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    scenario = scene(mesh_table(saved(tmp_path, sphere), roughness=ROUGH))
    with pytest.raises(ScenarioError, match=r"a rough mesh needs flat faces larger than a correl"):
        object_surface(scenario, "it", seed=0)


# ---- what is refused


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    refused(
        r"^objects\.it\.file: mesh file '.*none\.ply': No such file or directory; give the path",
        mesh_table(str(tmp_path / "none.ply")),
    )


def test_an_empty_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "it.stl").touch()
    refused(
        r"a file of 1 byte to 2 GiB is needed, this has 0 bytes; export",
        mesh_table(str(tmp_path / "it.stl")),
    )


def test_a_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "it.ply").mkdir()
    refused("a file of 1 byte to", mesh_table(str(tmp_path / "it.ply")))


def test_a_foreign_format_is_refused(tmp_path: Path) -> None:
    refused(r"unknown format '\.blend'; use one of \.ply, \.stl", mesh_table("it.blend"))


@pytest.mark.parametrize("kind", ["ply", "stl", "obj", "off"])
def test_rubbish_is_refused(tmp_path: Path, kind: str) -> None:
    (tmp_path / f"it.{kind}").write_bytes(bytes(range(256)) * 9)
    refused("cannot be read as|holds no triangle", mesh_table(str(tmp_path / f"it.{kind}")))


def test_a_mesh_without_triangles_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "it.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    refused(r"cannot be read as OBJ|holds no triangle", mesh_table(str(file)))


def test_a_mesh_without_area_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "it.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    refused("holds no triangle", mesh_table(str(file)))


def test_a_mesh_that_is_too_large_is_refused_with_its_scale(tmp_path: Path) -> None:
    file = saved(tmp_path, cube(5000.0))
    refused("within 1000 m after scaling by 1; set 'scale'", mesh_table(file))
    scene(mesh_table(file, scale=1e-5))


def test_a_mesh_with_vertices_that_are_no_numbers_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "it.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n")
    refused("a vertex is not finite", mesh_table(str(file)))


def test_a_closed_mesh_wound_both_ways_is_wound_one_way(tmp_path: Path) -> None:
    mesh = cube()
    faces = np.array(mesh.faces)
    faces[0] = faces[0, ::-1]
    file = saved(tmp_path, trimesh.Trimesh(mesh.vertices, faces, process=False))
    assert placed_mesh(body_of(mesh_table(file))).volume == pytest.approx(1e-3, rel=1e-6)


def test_an_open_mesh_is_refused_where_a_solid_is_asked_for(tmp_path: Path) -> None:
    mesh = cube()
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    refused(
        r"^objects\.it\.file: .*: 3 of its edges do not belong to exactly two triangles, and "
        r"solid = true needs a watertight mesh; close its holes .* or set solid = false",
        mesh_table(saved(tmp_path, mesh), solid=True),
    )
    assert object_surface(
        scene(mesh_table(saved(tmp_path, cube()), solid=True)), "it", seed=0
    ).closed


def test_a_mesh_is_not_both_solid_and_hollow(tmp_path: Path) -> None:
    refused(
        r"solid = true and hollow = true exclude each other; remove one",
        mesh_table(saved(tmp_path, cube()), solid=True, hollow=True),
    )


def test_a_mesh_of_too_many_facets_is_refused(tmp_path: Path) -> None:
    file = saved(tmp_path, cube(20.0))
    refused(
        r"^objects\.it: needs .* facets at a spacing of 1\.25 mm",
        mesh_table(file, centre_m=[0, 50], roughness={"rms_mm": 0.1, "correlation_mm": 10.0}),
    )
    body = scene(mesh_table(saved(tmp_path, cube(), "small.ply")))
    with pytest.raises(ScenarioError, match=r"facets at a spacing of 0\.0001 mm"):
        object_surface(body, "it", seed=0, spacing=1e-7)


# ---- placement


def test_an_array_or_a_user_inside_a_mesh_is_refused(tmp_path: Path) -> None:
    table = mesh_table(saved(tmp_path, cube()))
    refused("the array is inside objects.it", table | {"centre_m": [0, 0, 0]})
    refused(
        r"^users\.ann\..*is inside objects\.it", table,
        users={"ann": {"position_m": [0.01, 0.52, 0.03]}},
    )  # fmt: skip


def test_a_user_close_to_a_mesh_is_refused(tmp_path: Path) -> None:
    table = mesh_table(saved(tmp_path, cube()))
    refused(
        r"^users\.ann\..*is 3 mm from objects\.it; it must keep 5\.26 mm", table,
        users={"ann": {"position_m": [0.0, 0.5, 0.053]}},
    )  # fmt: skip
    scene(table, users={"ann": {"position_m": [0.0, 0.5, 0.056]}})


@pytest.mark.parametrize(
    "other",
    [
        {"kind": "box", "centre_m": [0.1, 0.5, 0], "length_m": 0.2, "depth_m": 0.2},
        {"kind": "cylinder", "centre_m": [0.0, 0.5, 0], "radius_m": 0.01},
        {"kind": "cylinder", "centre_m": [0.0, 0.5, 0], "radius_m": 0.3},
    ],
)
def test_solids_that_overlap_a_mesh_are_refused(tmp_path: Path, other: Table) -> None:
    table = mesh_table(saved(tmp_path, cube()))
    body = {"material": "metal", "height_m": 0.2, **other}
    refused(r"^objects\.b\.centre_m = .*overlaps objects\.it", table, objects={"b": body})


def test_meshes_that_overlap_are_refused_and_may_touch(tmp_path: Path) -> None:
    table = mesh_table(saved(tmp_path, cube()))
    other = table | {"centre_m": [0.09, 0.52, 0.01]}
    refused(r"^objects\.b\.centre_m = .*overlaps objects\.it", table, objects={"b": other})
    scene(table, objects={"b": table | {"centre_m": [0.1, 0.5, 0.0]}})


def test_inside_and_distance_of_a_mesh_agree_with_the_ball(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    body = body_of(mesh_table(saved(tmp_path, ball), centre_m=[0, 0.5, 0]))
    rng = np.random.default_rng(2)
    points = np.array([0, 0.5, 0]) + rng.uniform(-0.08, 0.08, (300, 3))
    radius = np.linalg.norm(points - [0, 0.5, 0], axis=-1)
    sagitta = 0.05 * (1 - ball.face_normals[0] @ ball.triangles[0, 0] / 0.05)
    clear = np.abs(radius - 0.05) > 2 * sagitta
    distances = mesh_distance(body, points, farthest=1.0)
    assert np.array_equal(distances[clear] < 0, radius[clear] < 0.05)
    np.testing.assert_allclose(distances[clear], (radius - 0.05)[clear], atol=2 * sagitta)
    inside = mesh_contains(body, points, deeper_than=0.01)
    deep = np.abs(radius - 0.04) > 2 * sagitta
    assert np.array_equal(inside[deep], radius[deep] < 0.04)


def test_nothing_is_inside_an_open_mesh(tmp_path: Path) -> None:
    mesh = cube()
    mesh.update_faces(np.arange(len(mesh.faces)) > 1)
    body = body_of(mesh_table(saved(tmp_path, mesh)))
    assert not mesh_contains(body, np.array([[0, 0.5, 0]]), deeper_than=1e-6).any()
