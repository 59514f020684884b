"""Consistent outward orientation of a mesh, for each connected part, cavities included.

Files hold several bodies in one mesh, some inside out, some with single triangles turned. The
triangles of each connected part are first wound alike along shared edges, then, where the part is
closed, so that its normals point away from what is solid. A part inside another is a cavity, a
part inside a cavity solid again.
"""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from scenes.meshes.triangle_mesh import TriangleMesh

_CHUNK = 2_000_000
"""Pairs of point and triangle held at once: some 200 MB of solid angles."""


def oriented(mesh: TriangleMesh) -> TriangleMesh:
    """Wind the triangles of each connected part alike, of each closed one outward.

    Parameters
    ----------
    mesh
        Its triangles may have any winding. A connected part consists of triangles joined by
        edges that exactly two triangles share.

    Returns
    -------
    The same triangles in the same order. A part that cannot be wound one way (a Möbius strip)
    keeps its winding; an open one is wound alike, towards either side.
    """
    from scipy.sparse import coo_array  # takes long to import
    from scipy.sparse.csgraph import connected_components

    pairs, count = mesh.neighbours, len(mesh.faces)
    links = coo_array((np.ones(len(pairs), dtype=np.int8), pairs.T), shape=(count, count)).tocsr()
    parts, part = connected_components(links, directed=False)
    turned = _wound_alike(links, part, pairs, mesh.against)
    clash = turned[pairs[:, 0]] ^ turned[pairs[:, 1]] ^ mesh.against
    turned &= ~np.isin(part, part[pairs[clash, 0]])
    faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    closed = _closed(mesh, part, parts)
    bodies = [np.flatnonzero(part == one) for one in np.flatnonzero(closed)]
    for members in bodies:
        triangles = mesh.vertices[faces[members]]
        depth = sum(
            _holds(mesh.vertices[faces[other]], triangles[0, 0])
            for other in bodies
            if other is not members and _may_hold(mesh.vertices[faces[other]], triangles)
        )
        if (_volume(triangles) < 0) != bool(depth % 2):
            faces[members] = faces[members][:, ::-1]
    if np.array_equal(faces, mesh.faces):
        return mesh
    return TriangleMesh(vertices=mesh.vertices, faces=np.ascontiguousarray(faces))


def _wound_alike(
    links: Any,  # csr_array
    part: Int[np.ndarray, " faces"],
    pairs: Int[np.ndarray, "pairs 2"],
    against: Bool[np.ndarray, " pairs"],
) -> Bool[np.ndarray, " faces"]:
    """Tell which triangles to reverse, so that each part is wound like its first triangle."""
    from scipy.sparse.csgraph import breadth_first_order

    turned = np.zeros(len(part), dtype=bool)
    disagree = {tuple(pair) for pair in np.sort(pairs[against], axis=1).tolist()}
    affected = np.unique(part[pairs[against, 0]])
    for one in affected:
        start = int(np.flatnonzero(part == one)[0])
        order, before = breadth_first_order(links, start, directed=False)
        for face in order[1:].tolist():
            last = int(before[face])
            turned[face] = turned[last] ^ ((min(face, last), max(face, last)) in disagree)
    return turned


def _closed(
    mesh: TriangleMesh, part: Int[np.ndarray, " faces"], parts: int
) -> Bool[np.ndarray, " parts"]:
    """Tell which parts are closed: each triangle has three neighbours."""
    neighbours = np.bincount(mesh.neighbours.ravel(), minlength=len(part))
    open_faces = np.bincount(part, weights=neighbours != 3, minlength=parts)
    return np.asarray(open_faces == 0)


def _volume(triangles: Float[np.ndarray, "faces 3 3"]) -> float:
    a, b, c = np.moveaxis(triangles - triangles.mean(axis=(0, 1)), 1, 0)
    return float(np.einsum("fx,fx->f", a, np.cross(b, c)).sum())


def _may_hold(
    outer: Float[np.ndarray, "faces 3 3"], inner: Float[np.ndarray, "others 3 3"]
) -> bool:
    """Tell whether one bounding box lies within another."""
    low, high = outer.min(axis=(0, 1)), outer.max(axis=(0, 1))
    return bool((inner.min(axis=(0, 1)) > low).all() and (inner.max(axis=(0, 1)) < high).all())


def _holds(triangles: Float[np.ndarray, "faces 3 3"], point: Float[np.ndarray, " 3"]) -> bool:
    return bool(abs(solid_angles(triangles, point[None])[0]) > 2 * np.pi)


def solid_angles(
    triangles: Float[np.ndarray, "faces 3 3"], points: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, " points"]:
    """Solid angle that a surface subtends at points: 4π within a closed one, 0 outside [sr].

    After van Oosterom and Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed.
    Eng. 30 (1983).
    """
    angles = np.empty(len(points))
    chunk = max(1, _CHUNK // len(triangles))
    for first in range(0, len(points), chunk):
        some = slice(first, first + chunk)
        a, b, c = np.moveaxis(triangles[None] - points[some, None, None, :], 2, 0)
        la, lb, lc = (np.linalg.norm(edge, axis=-1) for edge in (a, b, c))
        volume = np.einsum("pfx,pfx->pf", a, np.cross(b, c))
        cosines = la * lb * lc
        for one, other, length in ((a, b, lc), (b, c, la), (c, a, lb)):
            cosines += np.einsum("pfx,pfx->pf", one, other) * length
        angles[some] = 2 * np.arctan2(volume, cosines).sum(axis=-1)
    return angles
