"""Flat faces of meshes: walls, however they are cut into triangles."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from jaxtyping import Float

from scenes.meshes.ply_writer import ply_bytes
from scenes.meshes.triangle_mesh import TriangleMesh, cleaned
from scenes.scenario import parse_scenario
from simulator.geometry.flat_faces import flat_faces
from simulator.geometry.mirrors import Mirrors
from simulator.materials.fresnel_slab import Conductor
from simulator.simulation import simulate


def mesh(made: trimesh.Trimesh, cuts: int = 0) -> TriangleMesh:
    for _ in range(cuts):
        made = made.subdivide()
    return cleaned(np.asarray(made.vertices, dtype=float), np.asarray(made.faces))


def areas(faces: Float[np.ndarray, "faces 4 3"]) -> Float[np.ndarray, " faces"]:
    across = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    return np.asarray(np.linalg.norm(across, axis=-1) / 2)


def extruded(outline: list[tuple[float, float]], depth: float = 0.1) -> TriangleMesh:
    """Stand a polygon's outline up as walls, without floor and ceiling."""
    points = np.array(outline, dtype=float)
    count = len(points)
    vertices = np.concatenate([np.column_stack([points, np.full(count, z)]) for z in (0.0, depth)])
    here, after = np.arange(count), np.roll(np.arange(count), -1)
    faces = np.concatenate(
        [
            np.stack([here, after, after + count], axis=-1),
            np.stack([here, after + count, here + count], axis=-1),
        ]
    )
    return cleaned(vertices, faces)


@pytest.mark.parametrize("cuts", [0, 1, 3])
def test_a_box_has_six_faces_however_finely_it_is_cut(cuts: int) -> None:
    found = flat_faces(mesh(trimesh.creation.box((0.4, 0.6, 0.8)), cuts))
    assert len(found) == 6
    np.testing.assert_allclose(
        np.sort(areas(found)), np.sort([0.24, 0.24, 0.32, 0.32, 0.48, 0.48]), rtol=1e-12
    )
    outward = np.cross(found[:, 2] - found[:, 0], found[:, 3] - found[:, 1])
    assert np.all(np.einsum("fx,fx->f", outward, found.mean(axis=1)) > 0)


def test_a_curved_body_keeps_its_triangles() -> None:
    ball = mesh(trimesh.creation.icosphere(subdivisions=2, radius=0.1))
    assert len(flat_faces(ball)) == len(ball.faces)


def test_a_polygon_of_many_corners_is_covered_without_gap_or_overlap() -> None:
    turn = 2 * np.pi * np.arange(9) / 9
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(9)])
    disk = cleaned(
        np.concatenate([ring, np.zeros((1, 3))]),
        np.array([(k, (k + 1) % 9, 9) for k in range(9)]),
    )
    found = flat_faces(disk)
    assert len(found) == 4  # (9 - 2) / 2, rounded up
    assert areas(found).sum() == pytest.approx(4.5 * np.sin(2 * np.pi / 9))


def test_a_wall_with_a_window_reflects_around_it_only() -> None:
    corners = [(x, y, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    window = [(0.4 * x, 0.4 * y, 0.0) for x, y, _ in corners]
    faces = [
        part
        for k in range(4)
        for part in ((k, (k + 1) % 4, 4 + (k + 1) % 4), (k, 4 + (k + 1) % 4, 4 + k))
    ]
    found = flat_faces(cleaned(np.array(corners + window), np.array(faces)))
    mirrors = as_mirrors(found)
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-1.0, 1.0, (2000, 2)), np.zeros(2000)])
    hits = sum(mirrors.reflects_at(points, k).astype(int) for k in range(len(mirrors)))
    inside = (np.abs(points[:, :2]) < 0.4).all(axis=-1)
    np.testing.assert_array_equal(hits, np.where(inside, 0, 1))


def test_the_walls_of_a_room_with_a_recess_are_one_face_each() -> None:
    outline = [(0, 0), (1, 0), (1, 0.4), (0.7, 0.4), (0.7, 1), (0, 1)]
    found = flat_faces(extruded([(float(x), float(y)) for x, y in outline]))
    assert len(found) == 6
    np.testing.assert_allclose(np.sort(areas(found)), [0.03, 0.04, 0.06, 0.07, 0.1, 0.1])


def as_mirrors(corners: Float[np.ndarray, "faces 4 3"]) -> Mirrors:
    count = len(corners)
    return Mirrors(
        corners=corners,
        materials=(Conductor(),) * count,
        rms_heights=np.zeros(count),
        two_sided=np.ones(count, dtype=bool),
    )


def test_a_point_on_the_seam_of_two_mirrors_is_on_one_of_them() -> None:
    square = np.array([[-0.6, -0.5, 0.2], [0.6, -0.5, 0.2], [0.6, 0.5, 0.2], [-0.6, 0.5, 0.2]])
    halves = as_mirrors(square[[[0, 1, 2, 2], [0, 2, 3, 3]]])
    share = np.linspace(0.01, 0.99, 500)[:, None]
    points = square[0] + share * (square[2] - square[0])
    points += np.random.default_rng(0).normal(scale=1e-15, size=points.shape)
    hits = [halves.reflects_at(points, k) for k in range(2)]
    np.testing.assert_array_equal(hits[0], ~hits[1])


def room(folder: Path, cuts: int, shift: float = 0.0) -> np.ndarray:
    """Simulate the uplink in a hollow metal room, cut into 12 · 4^cuts triangles."""
    box = mesh(trimesh.creation.box((0.6, 0.5, 0.4)), cuts)
    path = folder / f"room_{cuts}.ply"
    path.write_bytes(ply_bytes(box.vertices, box.faces))
    table = {"kind": "mesh", "material": "metal", "file": str(path), "hollow": True}
    scenario = parse_scenario(
        {
            "name": "room",
            "dimensions": 3,
            "max_bounces": 2,
            "radio": {"start_ghz": 10.0, "stop_ghz": 11.0, "points": 11},
            "base_station": {
                "elements": [1, 1],
                "spacing_mm": 15.0,
                "position_m": [shift - 0.18, -0.15 - shift, 0.05],
            },
            "objects": {"room": {**table, "centre_m": [shift, -shift, 0.0]}},
            # In the plane of the diagonals of floor and ceiling, where triangles meet.
            "users": {"ann": {"position_m": [shift + 0.12, 0.1 - shift, -0.075]}},
        }
    )
    return np.asarray(simulate(scenario, seed=0).measurement.uplinks[0].samples)


def test_a_room_sounds_the_same_however_it_is_cut_and_wherever_it_stands(tmp_path: Path) -> None:
    coarse = room(tmp_path, 0)
    for other in (room(tmp_path, 1), room(tmp_path, 0, shift=400.0)):
        # Facets and single precision of what the ray tracer is given.
        assert np.abs(other - coarse).max() < 1e-3 * np.abs(coarse).max()
