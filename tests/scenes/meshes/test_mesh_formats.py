import struct
import time

import numpy as np
import pytest
import trimesh

from scenes.meshes.mesh_formats import read_mesh
from scenes.meshes.orientation import oriented
from scenes.meshes.ply_writer import ply_bytes
from scenes.meshes.polygons import Polygons, triangles_of
from scenes.meshes.triangle_mesh import TriangleMesh, cleaned, distances_to_triangles

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 2, 0]])
HOUSE = [[0, 1, 2, 3], [3, 2, 4]]  # a quadrangle below a triangle
TRIANGLES = [[0, 1, 2], [0, 2, 3], [3, 2, 4]]


def house_ply(order: str, *, extra: bool = False) -> bytes:
    """A PLY file of the house: colours between the coordinates, and flags on the faces."""
    kind = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    lines = ["ply", f"format {kind} 1.0", "comment a house", "element vertex 5"]
    lines += ["property float x", "property uchar red", "property double y", "property float z"]
    lines += ["element face 2", "property list uchar int vertex_indices"]
    lines += ["property short flag"] if extra else []
    lines += ["element edge 1", "property int vertex1", "end_header", ""]
    parts = []
    for x, y, z in SQUARE:
        parts.append(struct.pack(order + "fBdf", x, 7, y, z) if order else f"{x} 7 {y} {z}\n")
    for corners in HOUSE:
        row = [len(corners), *corners, *([9] if extra else [])]
        form = f"{order}B{len(corners)}i{'h' if extra else ''}"
        parts.append(struct.pack(form, *row) if order else " ".join(map(str, row)) + "\n")
    parts.append(struct.pack(order + "i", 3) if order else "3\n")
    body = b"".join(part.encode() if isinstance(part, str) else part for part in parts)
    return "\n".join(lines).encode() + body


@pytest.mark.parametrize("extra", [False, True])
@pytest.mark.parametrize("order", ["", "<", ">"])
def test_a_ply_file_is_read_in_text_and_in_both_byte_orders(order: str, extra: bool) -> None:
    vertices, faces = read_mesh(house_ply(order, extra=extra), "ply")
    np.testing.assert_array_equal(vertices, SQUARE)
    np.testing.assert_array_equal(faces, TRIANGLES)


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_a_ply_file_cut_off_anywhere_is_refused(order: str) -> None:
    whole = house_ply(order, extra=True)
    for length in range(0, len(whole) - 6, 3):  # the last table is not needed
        with pytest.raises(ValueError, match=r"truncated|header|no element|broadcast|convert|lack"):
            read_mesh(whole[:length], "ply")


def test_a_ply_file_that_promises_too_much_is_refused_at_once() -> None:
    # No memory is taken on the word of a header.
    huge = house_ply("<").replace(b"element vertex 5", b"element vertex 999999999999")
    started = time.perf_counter()
    with pytest.raises(ValueError, match="'vertex' is truncated"):
        read_mesh(huge, "ply")
    assert time.perf_counter() - started < 1.0


def test_ply_text_written_by_us_is_read_exactly() -> None:
    rng = np.random.default_rng(1)
    vertices, faces = rng.normal(size=(20, 3)), rng.integers(0, 20, (30, 3))
    again, triangles = read_mesh(ply_bytes(vertices, faces), "ply")
    np.testing.assert_array_equal(again, vertices)
    np.testing.assert_array_equal(triangles, faces)


@pytest.mark.parametrize(
    "body",
    [
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 2 0\nf 1 2 3 4\nf 4 3 5\n",
        "# by hand\r\nmtllib /etc/passwd\r\nv 0 0 0 1.0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\n"
        "vt 0 0\r\nvn 0 0 1\r\nf 1/1/1 2/1/1 3//1 \\\r\n 4\r\nv .5 2 0\r\ng top\r\nf -2 3 -1\r\n",
    ],
    ids=["plain", "with all it may hold"],
)
def test_an_obj_file_is_read(body: str) -> None:
    vertices, faces = read_mesh(body.encode(), "obj")
    np.testing.assert_array_equal(vertices, SQUARE)
    np.testing.assert_array_equal(faces, TRIANGLES)


@pytest.mark.parametrize("head", ["OFF\n5 2 0\n", "# a house\nOFF 5 2 0\n\n", "COFF\n5 2 6 # n\n"])
def test_an_off_file_is_read(head: str) -> None:
    colour = " 255 0 0" if head.startswith("C") else ""
    points = "".join(f"{x} {y} {z}{colour}\n" for x, y, z in SQUARE)
    vertices, faces = read_mesh(f"{head}{points}4 0 1 2 3 0.5 0.5\n3 3 2 4\n".encode(), "off")
    np.testing.assert_array_equal(vertices, SQUARE)
    np.testing.assert_array_equal(faces, TRIANGLES)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply", "obj", "off"])
def test_what_another_program_writes_is_read_as_it_reads_it(kind: str) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    written = mesh.export(file_type=kind)
    content = written.encode() if isinstance(written, str) else written
    vertices, faces = read_mesh(content, kind.removesuffix("_ascii"))
    # Single precision, or 8 digits after the point.
    np.testing.assert_allclose(vertices[faces], mesh.triangles, rtol=1e-6, atol=1e-8)


def test_a_binary_stl_file_may_begin_with_the_word_solid() -> None:
    content = trimesh.creation.box().export(file_type="stl")
    vertices, faces = read_mesh(b"solid" + content[5:], "stl")
    assert cleaned(vertices, faces).volume == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("kind", "content", "message"),
    [
        ("ply", b"plywood", "no header from 'ply' to 'end_header'"),
        ("ply", b"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "no element 'vertex'"),
        ("ply", b"ply\nelement vertex 1\nend_header\n", "must have one line 'format'"),
        ("ply", b"ply\nformat ascii 1.0\nproperty tensor x\nend_header\n", "'property tensor x'"),
        ("ply", b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "lack a number 'x'"),
        ("stl", bytes(80) + b"\x02\0\0\0" + bytes(50), "134 bytes are too few for its 2 triangles"),
        ("stl", b"solid\nvertex 0 0 0\nvertex 1 0 0\nend", "2 vertices make no triangles"),
        ("obj", b"v 0 0 0\nf 0 0 0\n", "vertex 0, and the first is 1"),
        ("obj", b"v 0 0 0\nf 1 1 2\n", "a face has vertex 1, and there are 1"),
        ("obj", b"v 0 0 x\nf 1 1 1\n", "could not convert"),
        ("off", b"ON\n1 1 1\n", "does not begin with 'OFF'"),
        ("off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n", "truncated"),
        ("off", b"OFF\n1 1 0\n0 0 0\n3 0 0\n", "fewer corners than it says"),
    ],
)
def test_what_is_no_mesh_is_refused(kind: str, content: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_mesh(content, kind)


def test_vertices_in_one_place_are_joined_and_flat_triangles_dropped() -> None:
    vertices = np.array([[9.0, 9, 9], [0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1e-10, 0], [2, 0, 0]])
    mesh = cleaned(vertices, np.array([[1, 2, 3], [1, 4, 3], [1, 2, 5], [1, 1, 3]]))
    np.testing.assert_array_equal(mesh.vertices, vertices[1:4])
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 1, 2]])


def test_closedness_winding_volume_and_neighbours_agree_with_another_program() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=0.3)
    for last in (320, 317):
        made = TriangleMesh(
            vertices=np.array(sphere.vertices + 5.0), faces=np.array(sphere.faces[:last])
        )
        other = trimesh.Trimesh(made.vertices, made.faces, process=False)
        assert made.is_watertight is (last == 320)
        assert made.is_watertight == other.is_watertight
        assert oriented(made) is made
        assert made.area == pytest.approx(other.area, rel=1e-12)
        assert {frozenset(pair) for pair in made.neighbours.tolist()} == {
            frozenset(pair) for pair in other.face_adjacency.tolist()
        }
        np.testing.assert_allclose(made.normals, other.face_normals, atol=1e-12)
    whole = TriangleMesh(vertices=np.array(sphere.vertices), faces=np.array(sphere.faces))
    assert whole.volume == pytest.approx(sphere.volume, rel=1e-12)
    inside_out = TriangleMesh(vertices=whole.vertices, faces=whole.faces[:, ::-1])
    assert inside_out.volume == pytest.approx(-sphere.volume, rel=1e-12)
    np.testing.assert_array_equal(oriented(inside_out).faces[:, ::-1], inside_out.faces)


def test_the_distance_to_a_triangle_is_that_to_the_nearest_of_its_points() -> None:
    rng = np.random.default_rng(4)
    triangles = rng.normal(size=(200, 3, 3))
    point = rng.normal(size=3)
    repeated = np.broadcast_to(point, (200, 3))
    closest = trimesh.triangles.closest_point(triangles, repeated)  # type: ignore[no-untyped-call]
    np.testing.assert_allclose(
        distances_to_triangles(point, triangles),
        np.linalg.norm(closest - point, axis=-1),
        rtol=1e-9,
    )


def test_a_polygon_of_two_corners_is_no_triangle() -> None:
    line = Polygons(vertices=SQUARE, corners=np.array([0, 1, 0, 1, 2]), counts=np.array([2, 3]))
    np.testing.assert_array_equal(triangles_of(line), [[0, 1, 2]])
