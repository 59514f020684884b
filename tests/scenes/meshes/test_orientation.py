"""Each connected part of a mesh knows its own outside."""

import numpy as np
import pytest
import trimesh
from jaxtyping import Float

from scenes.meshes.orientation import oriented, solid_angles
from scenes.meshes.triangle_mesh import TriangleMesh, cleaned


def joined(*parts: trimesh.Trimesh) -> TriangleMesh:
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    vertices = np.concatenate([np.asarray(part.vertices, dtype=float) for part in parts])
    faces = [start + np.asarray(part.faces) for start, part in zip(first, parts, strict=False)]
    return cleaned(vertices, np.concatenate(faces))


def box(side: float, *, at: float = 0.0, inside_out: bool = False) -> trimesh.Trimesh:
    made: trimesh.Trimesh = trimesh.creation.box((side, side, side))
    made.apply_translation((at, 0.0, 0.0))
    if inside_out:
        made.invert()
    return made


def part_volume(mesh: TriangleMesh, low: float, high: float) -> float:
    x = mesh.triangles[..., 0].mean(axis=-1)
    faces = mesh.faces[(x >= low) & (x <= high)]
    return TriangleMesh(vertices=mesh.vertices, faces=faces).volume


def test_of_two_bodies_the_one_inside_out_is_turned() -> None:
    found = oriented(joined(box(0.2), box(0.1, at=1.0, inside_out=True)))
    assert part_volume(found, -0.5, 0.5) == pytest.approx(8e-3)
    assert part_volume(found, 0.5, 1.5) == pytest.approx(1e-3)


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_part_within_another_is_a_cavity_and_one_within_that_is_solid(inside_out: bool) -> None:
    nested = joined(box(0.4, inside_out=inside_out), box(0.2), box(0.1, inside_out=inside_out))
    assert oriented(nested).volume == pytest.approx(0.064 - 0.008 + 0.001)


@pytest.mark.parametrize("seed", range(5))
def test_single_triangles_that_are_turned_are_turned_back(seed: int) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    mesh = joined(ball)
    turned = np.random.default_rng(seed).random(len(mesh.faces)) < 0.4
    faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    found = oriented(TriangleMesh(vertices=mesh.vertices, faces=faces))
    assert not found.against.any()
    assert found.volume == pytest.approx(ball.volume)


def test_a_sheet_is_wound_alike() -> None:
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(16)])
    first = [4 * row + column for row in range(3) for column in range(3)]
    faces = np.array([face for k in first for face in ((k, k + 1, k + 5), (k + 5, k, k + 4))])
    faces[::3] = faces[::3, ::-1]
    normals = oriented(TriangleMesh(vertices=vertices, faces=faces)).normals
    np.testing.assert_allclose(normals, normals[:1].repeat(len(faces), axis=0))


def moebius(steps: int = 12) -> TriangleMesh:
    turn = 2 * np.pi * np.arange(steps) / steps
    rim = [
        np.column_stack(
            [
                (1 + s * np.cos(turn / 2)) * np.cos(turn),
                (1 + s * np.cos(turn / 2)) * np.sin(turn),
                s * np.sin(turn / 2),
            ]
        )
        for s in (-0.3, 0.3)
    ]
    faces = []
    for k in range(steps):
        a, b = k, steps + k
        c, d = (k + 1, steps + k + 1) if k + 1 < steps else (steps, 0)
        faces += [(a, c, d), (a, d, b)]
    return TriangleMesh(vertices=np.concatenate(rim), faces=np.array(faces))


def test_a_strip_without_two_sides_is_left_as_it_is() -> None:
    strip = moebius()
    assert oriented(strip) is strip


def test_the_solid_angle_is_that_of_a_sphere_inside_and_nothing_outside() -> None:
    ball = joined(trimesh.creation.icosphere(subdivisions=3, radius=0.1))
    points: Float[np.ndarray, "2 3"] = np.array([[0.02, 0.03, -0.05], [0.2, 0.0, 0.1]])
    np.testing.assert_allclose(solid_angles(ball.triangles, points), [4 * np.pi, 0.0], atol=1e-12)
