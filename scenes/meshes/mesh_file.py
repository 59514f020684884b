"""Triangle meshes from files: checked, scaled, rotated and moved into the world frame."""

import functools
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from scenes.meshes.mesh_formats import READERS, read_mesh
from scenes.meshes.orientation import oriented, solid_angles
from scenes.meshes.triangle_mesh import TriangleMesh, cleaned, distances_to_triangles
from scenes.schema.errors import ScenarioError
from scenes.schema.objects import MeshFile
from scenes.schema.quantities import FARTHEST

FORMATS = tuple(f".{kind}" for kind in READERS)

LARGEST_FILE = 2 * 2**30
"""Largest mesh file that is read [byte]."""


def placed_mesh(body: MeshFile) -> TriangleMesh:
    """Read a mesh file, scale it, turn it about z, and move its origin to the centre.

    Each closed part of it is wound so that its normals point outward, each cavity within a part
    so that they point into it.

    Raises
    ------
    ScenarioError
        If the file is missing, empty, of a foreign format, holds no usable triangle, or is
        not watertight though it is told to be solid.
    """
    path = Path(body.file)
    if path.suffix.lower() not in FORMATS:
        raise ScenarioError(
            f"mesh file {body.file!r}: unknown format {path.suffix!r}; use one of "
            f"{', '.join(FORMATS)}"
        )
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        told = error.strerror if isinstance(error, OSError) else error
        raise ScenarioError(
            f"mesh file {body.file!r}: {told}; give the path of a mesh, relative to "
            "the scenario's file"
        ) from None
    if not path.is_file() or not 0 < status.st_size <= LARGEST_FILE:
        raise ScenarioError(
            f"mesh file {body.file!r}: a file of 1 byte to {LARGEST_FILE >> 30} GiB is needed, "
            f"this has {status.st_size} bytes; export the mesh again"
        )
    return _placed(body, status.st_mtime_ns, status.st_size)


SMALL_FILE = 2**17
"""Mesh files up to this size are kept by the thousand: a town has one for each house [byte]."""


def _placed(body: MeshFile, changed: int, size: int) -> TriangleMesh:
    return (_placed_small if size <= SMALL_FILE else _placed_large)(body, changed, size)


@functools.lru_cache(maxsize=8192)
def _placed_small(body: MeshFile, changed: int, size: int) -> TriangleMesh:
    return _read_and_placed(body)


@functools.lru_cache(maxsize=16)
def _placed_large(body: MeshFile, changed: int, size: int) -> TriangleMesh:
    return _read_and_placed(body)


def _read_and_placed(body: MeshFile) -> TriangleMesh:
    read = _read(body.file)
    axes = np.stack([body.tangent, body.across, np.array([0.0, 0.0, 1.0])])
    vertices = read.vertices
    if body.matrix is not None:
        affine = np.array(body.matrix).reshape(3, 4)
        vertices = vertices @ affine[:, :3].T + affine[:, 3]
    vertices = body.centre + body.scale * vertices @ axes
    if np.abs(vertices).max() > FARTHEST:
        raise ScenarioError(
            f"mesh file {body.file!r}: vertices must lie within {FARTHEST:g} m after "
            f"scaling by {body.scale:g}; set 'scale' to metres per unit of the file (0.001 for "
            "millimetres)"
        )
    mesh = TriangleMesh(vertices=vertices, faces=read.faces)
    if not mesh.areas.min() > 0:
        raise ScenarioError(
            f"mesh file {body.file!r}: a triangle has no area after 'scale' and 'matrix'; "
            "correct them, or export it again"
        )
    if body.solid and not mesh.is_watertight:
        raise ScenarioError(
            f"mesh file {body.file!r}: {mesh.open_edges} of its edges do not belong to exactly "
            "two triangles, and solid = true needs a watertight mesh; close its holes and export "
            "it again, or set solid = false (a sheet, seen from both sides)"
        )
    return oriented(mesh)


def _read(file: str) -> TriangleMesh:
    kind = Path(file).suffix.lower().removeprefix(".")
    try:
        # From memory, so that a mesh cannot name other files to be read.
        vertices, faces = read_mesh(Path(file).read_bytes(), kind)
        if not np.isfinite(vertices).all():
            raise ValueError("a vertex is not finite")
        mesh = cleaned(vertices, faces)
    except (ValueError, OverflowError, OSError, MemoryError) as error:
        raise ScenarioError(
            f"mesh file {file!r}: cannot be read as {kind.upper()} ({error}); export it again"
        ) from error
    if len(mesh.faces) == 0:
        raise ScenarioError(
            f"mesh file {file!r}: holds no triangle; export the surface, not points or curves"
        )
    return mesh


def mesh_distance(
    body: MeshFile, points: Float[np.ndarray, "points 3"], *, farthest: float
) -> Float[np.ndarray, " points"]:
    """Distance from points to a mesh, negative inside; infinite beyond ``farthest`` [m]."""
    mesh = placed_mesh(body)
    distances = np.full(len(points), np.inf)
    low, high = mesh.triangles.min(axis=1) - farthest, mesh.triangles.max(axis=1) + farthest
    around = ((points >= low.min(axis=0)) & (points <= high.max(axis=0))).all(axis=-1)
    for index in np.flatnonzero(around):
        near = ((points[index] >= low) & (points[index] <= high)).all(axis=-1)
        if near.any():
            gap = float(distances_to_triangles(points[index], mesh.triangles[near]).min())
            distances[index] = gap if gap <= farthest else np.inf
    inside = _inside(body, points)
    return np.where(inside, -np.minimum(distances, farthest), distances)


def mesh_contains(
    body: MeshFile, points: Float[np.ndarray, "points 3"], *, deeper_than: float
) -> Bool[np.ndarray, " points"]:
    """Tell which points lie inside a watertight mesh, deeper than ``deeper_than`` [m]."""
    if not _inside(body, points).any():
        return np.zeros(len(points), dtype=bool)
    return mesh_distance(body, points, farthest=2 * deeper_than) < -deeper_than


def _inside(body: MeshFile, points: Float[np.ndarray, "points 3"]) -> Bool[np.ndarray, " points"]:
    """Tell points inside by the solid angle that the surface subtends: 4π inside, 0 outside."""
    mesh = placed_mesh(body)
    inside = np.zeros(len(points), dtype=bool)
    if body.hollow or not mesh.is_watertight:
        return inside
    low, high = mesh.bounds
    candidates = np.flatnonzero(((points >= low) & (points <= high)).all(axis=-1))
    if candidates.size:
        angles = solid_angles(mesh.triangles, points[candidates])
        inside[candidates] = angles > 2 * np.pi
    return inside
