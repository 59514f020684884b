"""Triangle meshes from files, checked and put in their place."""

import functools
import io
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool, Float

from scenes.objects import MeshFile
from scenes.quantities import FARTHEST
from scenes.scenario_error import ScenarioError

FORMATS = (".ply", ".stl", ".obj", ".off")

LARGEST_FILE = 2 * 2**30
"""Largest mesh file that is read [byte]."""

_CHUNK = 2_000_000
"""Pairs of point and triangle held at once: some 200 MB of solid angles."""


def placed_mesh(body: MeshFile) -> trimesh.Trimesh:
    """Read a mesh file, scale it, turn it about z, and move its origin to the centre.

    The triangles of a watertight mesh are wound so that their normals point outward.

    Raises
    ------
    ScenarioError
        If the file is missing, empty, of a foreign format, or holds no usable triangle.
    """
    path = Path(body.file)
    if path.suffix.lower() not in FORMATS:
        raise ScenarioError(
            f"mesh file {body.file!r}: unknown format {path.suffix!r}; use one of "
            f"{', '.join(FORMATS)}"
        )
    try:
        status = path.stat()
    except OSError as error:
        raise ScenarioError(
            f"mesh file {body.file!r}: {error.strerror}; give the path of a mesh, relative to "
            "the scenario's file"
        ) from None
    if not path.is_file() or not 0 < status.st_size <= LARGEST_FILE:
        raise ScenarioError(
            f"mesh file {body.file!r}: a file of 1 byte to {LARGEST_FILE >> 30} GiB is needed, "
            f"this has {status.st_size} bytes; export the mesh again"
        )
    return _placed(body, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=16)
def _placed(body: MeshFile, changed: int, size: int) -> trimesh.Trimesh:
    mesh = _read(body.file)
    axes = np.stack([body.tangent, body.across, np.array([0.0, 0.0, 1.0])])
    if body.matrix is not None:
        affine = np.array(body.matrix).reshape(3, 4)
        mesh.vertices = np.asarray(mesh.vertices) @ affine[:, :3].T + affine[:, 3]
    mesh.vertices = body.centre + body.scale * np.asarray(mesh.vertices) @ axes
    if np.abs(mesh.vertices).max() > FARTHEST:
        raise ScenarioError(
            f"mesh file {body.file!r}: vertices must lie within {FARTHEST:g} m after "
            f"scaling by {body.scale:g}; set 'scale' to metres per unit of the file"
        )
    if not mesh.area > 0:
        raise ScenarioError(f"mesh file {body.file!r}: its surface has no area; export it again")
    if mesh.is_watertight:
        if not mesh.is_winding_consistent:
            raise ScenarioError(
                f"mesh file {body.file!r}: it is closed, but its triangles are wound both ways; "
                "recalculate its normals outward and export it again"
            )
        if mesh.volume < 0:
            mesh.invert()
    return mesh


def _read(file: str) -> trimesh.Trimesh:
    kind = Path(file).suffix.lower().removeprefix(".")
    options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
    try:
        # From memory, so that a mesh cannot name other files to be read.
        content = io.BytesIO(Path(file).read_bytes())
        mesh = trimesh.load_mesh(content, file_type=kind, process=False, **options)
        if not np.isfinite(mesh.vertices).all():
            raise ValueError("a vertex is not finite")
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        mesh.update_faces(mesh.nondegenerate_faces())
        mesh.remove_unreferenced_vertices()
    except Exception as error:  # readers of foreign formats raise whatever they stumble over
        raise ScenarioError(
            f"mesh file {file!r}: cannot be read as {kind.upper()} ({error}); export it again"
        ) from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
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
            triangles = np.asarray(mesh.triangles)[near]
            repeated = np.broadcast_to(points[index], (len(triangles), 3))
            closest = trimesh.triangles.closest_point(triangles, repeated)  # type: ignore[no-untyped-call]
            gap = float(np.linalg.norm(closest - points[index], axis=-1).min())
            distances[index] = gap if gap <= farthest else np.inf
    inside = _inside(body, points)
    return np.where(inside, -np.minimum(distances, farthest), distances)


def mesh_contains(
    body: MeshFile, points: Float[np.ndarray, "points 3"], *, deeper_than: float
) -> Bool[np.ndarray, " points"]:
    """Tell which points lie inside a watertight mesh, and not just below its surface."""
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
    triangles = np.asarray(mesh.triangles, dtype=np.float64)
    chunk = max(1, _CHUNK // len(triangles))
    for first in range(0, len(candidates), chunk):
        some = candidates[first : first + chunk]
        a, b, c = np.moveaxis(triangles[None] - points[some, None, None, :], 2, 0)
        la, lb, lc = (np.linalg.norm(edge, axis=-1) for edge in (a, b, c))
        volume = np.einsum("pfx,pfx->pf", a, np.cross(b, c))
        cosines = la * lb * lc
        for one, other, length in ((a, b, lc), (b, c, la), (c, a, lb)):
            cosines += np.einsum("pfx,pfx->pf", one, other) * length
        angle = 2 * np.arctan2(volume, cosines).sum(axis=-1)
        inside[some] = angle > 2 * np.pi
    return inside
