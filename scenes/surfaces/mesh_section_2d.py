"""Meshes in two dimensions: the line facets in which upright walls meet the plane z = 0."""

import numpy as np
from jaxtyping import Bool, Float, Int

from scenes.meshes.mesh_file import placed_mesh
from scenes.schema.errors import ScenarioError
from scenes.schema.objects import MeshFile
from scenes.surfaces.facet_spacing import steps
from scenes.surfaces.heights import Heights
from scenes.surfaces.shape import Shape

UPRIGHT = 1e-4
"""Largest z of an upright triangle's unit normal: 10 µm over 10 cm [-]."""

SHORTEST = 1e-9
"""Shortest line that is kept; shorter ones are a corner's rounding [m]."""


def mesh_lines(body: MeshFile, spacing: float, heights: Heights) -> Shape:
    """Cut a mesh at z = 0 into lines of at most ``spacing``.

    With ``facets = "file"``, the upright strips that meet z = 0 are line facets as they are.

    Raises
    ------
    ScenarioError
        If nothing of the mesh meets z = 0, or what does is not upright, or it should be rough.
    """
    if not heights.smooth:
        raise ScenarioError(
            f"mesh file {body.file!r}: a mesh cannot be rough in two dimensions; set "
            "dimensions = 3, use a plate, box or cylinder, or leave it smooth (rms_mm = 0)"
        )
    starts, ends = mesh_segments(body)
    if body.facets == "cut":
        lengths = np.linalg.norm(ends - starts, axis=-1)
        counts = np.array([steps(float(length), spacing) for length in lengths])
        which = np.repeat(np.arange(len(counts)), counts)
        step = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
        along = (ends - starts)[which]
        first = starts[which] + along * (step / counts[which])[:, None]
        last = starts[which] + along * ((step + 1) / counts[which])[:, None]
        starts, ends = first, last
    vertices, cells = _joined(starts, ends)
    return Shape(vertices=vertices, mean_vertices=vertices, cells=cells)


def lines_are_closed(cells: Int[np.ndarray, "cells 2"]) -> bool:
    """Tell whether lines run in closed contours, so that only their outer side is seen."""
    count = int(cells.max()) + 1
    into, out = (np.bincount(cells[:, end], minlength=count) for end in (1, 0))
    return bool(np.all(into == 1) and np.all(out == 1))


def mesh_segments(
    body: MeshFile,
) -> tuple[Float[np.ndarray, "lines 3"], Float[np.ndarray, "lines 3"]]:
    """Find the lines in which a mesh meets z = 0; its outer side is to their right.

    Raises
    ------
    ScenarioError
        If there are none, or a wall is not upright.
    """
    mesh = placed_mesh(body)
    triangles, normals = mesh.triangles, mesh.normals
    above = triangles[:, :, 2] > 0.0
    meets = above.any(axis=1) & ~above.all(axis=1)
    if not meets.any():
        low, high = mesh.bounds[:, 2]
        raise ScenarioError(
            f"mesh file {body.file!r}: reaches from z = {low:.4g} to {high:.4g} m and does not "
            "cross the plane z = 0 of a 2-D scene; move it by centre_m or in its file, or set "
            "dimensions = 3"
        )
    if np.abs(normals[meets, 2]).max() > UPRIGHT:
        raise ScenarioError(
            f"mesh file {body.file!r}: a face at z = 0 is not upright (its normal's z is "
            f"{np.abs(normals[meets, 2]).max():.2g}, the limit {UPRIGHT:g}), and a 2-D scene is "
            "invariant along z; set dimensions = 3"
        )
    pick = _widest if body.facets == "file" else _section
    starts, ends = pick(triangles[meets], above[meets])
    way = ends - starts
    turned = way[:, 1] * normals[meets, 0] - way[:, 0] * normals[meets, 1] < 0.0
    starts, ends = (
        np.where(turned[:, None], ends, starts),
        np.where(turned[:, None], starts, ends),
    )
    kept = np.linalg.norm(ends - starts, axis=-1) > SHORTEST
    starts, ends = starts[kept], ends[kept]
    # Both triangles of a strip give the same line.
    _, first = np.unique(np.hstack([starts, ends]), axis=0, return_index=True)
    first = np.sort(first)
    return starts[first], ends[first]


def _section(
    triangles: Float[np.ndarray, "faces 3 3"], above: Bool[np.ndarray, "faces 3"]
) -> tuple[Float[np.ndarray, "faces 3"], Float[np.ndarray, "faces 3"]]:
    """Cut triangles by z = 0: two of the edges of each pass through it."""
    after = np.roll(triangles, -1, axis=1)
    passes = above != np.roll(above, -1, axis=1)
    rise = after[..., 2] - triangles[..., 2]
    share = np.divide(-triangles[..., 2], rise, out=np.zeros_like(rise), where=passes)
    points = triangles + share[..., None] * (after - triangles)
    points[..., 2] = 0.0
    pairs = points[passes].reshape(-1, 2, 3)
    return pairs[:, 0], pairs[:, 1]


def _widest(
    triangles: Float[np.ndarray, "faces 3 3"], above: Bool[np.ndarray, "faces 3"]
) -> tuple[Float[np.ndarray, "faces 3"], Float[np.ndarray, "faces 3"]]:
    """Take the two corners of upright triangles that lie farthest apart in the plan."""
    plan = triangles * [1.0, 1.0, 0.0]
    apart = np.linalg.norm(np.roll(plan, -1, axis=1) - plan, axis=-1)
    first = apart.argmax(axis=1)
    row = np.arange(len(plan))
    return plan[row, first], plan[row, (first + 1) % 3]


def _joined(
    starts: Float[np.ndarray, "lines 3"], ends: Float[np.ndarray, "lines 3"]
) -> tuple[Float[np.ndarray, "vertices 3"], Int[np.ndarray, "lines 2"]]:
    """Give each end of a line a number, the same to equal ends (to a tenth of a nanometre)."""
    points = np.concatenate([starts, ends])
    _, first, which = np.unique(
        np.round(points, 10), axis=0, return_index=True, return_inverse=True
    )
    return points[first], which.reshape(2, -1).T
