from pathlib import Path

import numpy as np
import pytest
import trimesh

from scenes.files.loading import load_scenario
from scenes.realisations.object_surface import Surface, object_surface
from scenes.realisations.surface_mesh import surface_to_mesh
from scenes.scenario import parse_scenario


def rough_box(*, tall: bool) -> Surface:
    body = {
        "kind": "box", "material": "metal", "centre_m": [0, 1], "length_m": 0.02, "depth_m": 0.01,
        "roughness": {"rms_mm": 0.05, "correlation_mm": 1.0}, "height_m": 0.01 if tall else None,
    }  # fmt: skip
    scenario = parse_scenario(
        {
            "name": "scene",
            "dimensions": 3 if tall else 2,
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 2},
            "base_station": {"elements": 2, "spacing_mm": 1.0},
            "objects": {"it": {key: v for key, v in body.items() if v is not None}},
        }
    )
    return object_surface(scenario, "it", seed=0)


def test_a_line_becomes_an_upright_strip_around_zero() -> None:
    wall = object_surface(load_scenario("slam_2d"), "wall", seed=0)
    mesh = surface_to_mesh(wall, extrude=0.1)
    assert len(mesh.faces) == 2 * len(wall.cells)
    np.testing.assert_allclose(mesh.bounds[:, 2], [-0.05, 0.05])
    lengths = np.linalg.norm(np.diff(wall.vertices, axis=0), axis=-1)
    assert mesh.area == pytest.approx(0.1 * lengths.sum())
    normals = np.asarray(mesh.face_normals)
    assert (normals @ np.array([1, -1, 0]) > 0).all()  # to the right of the way, as the cells


def test_a_closed_line_becomes_a_tube_with_its_normals_outward() -> None:
    made = rough_box(tall=False)
    mesh = surface_to_mesh(made, extrude=0.02)
    outward = np.asarray(mesh.triangles_center) - [0, 1, 0]
    # Rough slopes are 0.07, so a facet of a face may not look inward.
    assert (np.einsum("fx,fx->f", outward, np.asarray(mesh.face_normals)) > 0).all()


def test_triangles_are_kept_as_they_are() -> None:
    made = rough_box(tall=True)
    mesh = surface_to_mesh(made, extrude=None)
    np.testing.assert_array_equal(mesh.vertices, made.vertices)
    np.testing.assert_array_equal(mesh.faces, made.cells)
    assert mesh.is_watertight


def test_a_surface_survives_a_ply_file(tmp_path: Path) -> None:
    made = rough_box(tall=True)
    surface_to_mesh(made, extrude=None).export(tmp_path / "it.ply")
    read = trimesh.load_mesh(tmp_path / "it.ply", process=False)
    np.testing.assert_array_equal(read.faces, made.cells)
    np.testing.assert_allclose(read.vertices, made.vertices, atol=6e-8)  # single precision at 1 m


@pytest.mark.parametrize("extrude", [None, 0.0, -1.0, np.nan, np.inf])
def test_a_line_needs_a_height_to_become_a_mesh(extrude: float | None) -> None:
    with pytest.raises(ValueError, match=r"is a line: extrude = .* m must be a positive height"):
        surface_to_mesh(rough_box(tall=False), extrude=extrude)


def test_triangles_cannot_be_extruded() -> None:
    with pytest.raises(ValueError, match=r"has triangles and cannot be extruded by 0\.1 m"):
        surface_to_mesh(rough_box(tall=True), extrude=0.1)
