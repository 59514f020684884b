"""Flat faces of a triangle mesh: coplanar neighbouring triangles form one mirror.

A mesh does not mark its walls: a room of 12 triangles may be tessellated into 3000. Triangles that
share an edge and lie in one plane are joined to a face. A convex face is divided into
quadrilaterals, one for every two of its corners beyond two; one with a hole or a notch keeps its
triangles.
"""

import numpy as np
from jaxtyping import Float, Int

from scenes.meshes.triangle_mesh import TriangleMesh
from simulator.geometry.mirrors import FLATNESS, LEAST_AREA

LEAST_COSINE = 0.999
"""Least cosine between the normals of two triangles of one face: slivers are within
:data:`STRAIGHT` of planes of any direction, so that distance alone does not tell. [-]"""

STRAIGHT = FLATNESS
"""Distance of a corner from the line between its neighbours below which it is dropped. [m]"""


def flat_faces(mesh: TriangleMesh) -> Float[np.ndarray, "mirrors 4 3"]:
    """Join the coplanar triangles of a mesh, and divide the faces into convex quadrilaterals.

    Parameters
    ----------
    mesh
        Its triangles' normals follow their corners counter-clockwise.

    Returns
    -------
    Corners in order around the edge, in the sense of the triangles; a triangle repeats its last
    corner. Faces below the least area of a mirror are left out. [m]
    """
    found: list[Float[np.ndarray, "some 4 3"]] = []
    for members in _coplanar(mesh):
        outline = _outline(mesh.faces[members])
        corners = None
        if outline is not None:
            corners = _convex(mesh.vertices[outline], mesh.normals[members[0]])
        if corners is None:
            triangles = mesh.triangles[members]
            found.append(np.concatenate([triangles, triangles[:, 2:]], axis=1))
        else:
            found.append(_fan(corners))
    faces = np.concatenate([np.empty((0, 4, 3)), *found])
    across = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    return np.asarray(faces[np.linalg.norm(across, axis=-1) > 2 * LEAST_AREA])


def _coplanar(mesh: TriangleMesh) -> list[Int[np.ndarray, " members"]]:
    """Grow each face from its largest triangle over shared edges, within the plane of that one."""
    count = len(mesh.faces)
    beside: list[list[int]] = [[] for _ in range(count)]
    for one, other in mesh.neighbours.tolist():
        beside[one].append(other)
        beside[other].append(one)
    free = np.ones(count, dtype=bool)
    found = []
    for seed in np.argsort(-mesh.areas, kind="stable").tolist():
        if not free[seed]:
            continue
        normal, place = mesh.normals[seed], mesh.triangles[seed, 0]
        free[seed] = False
        members, reached = [seed], [seed]
        while reached:
            near = np.unique([other for one in reached for other in beside[one] if free[other]])
            near = near.astype(np.int64)
            heights = np.abs((mesh.triangles[near] - place) @ normal).max(axis=-1, initial=0.0)
            alike = mesh.normals[near] @ normal > LEAST_COSINE
            reached = near[(heights <= FLATNESS / 2) & alike].tolist()
            free[reached] = False
            members += reached
        found.append(np.array(members))
    return found


def _outline(faces: Int[np.ndarray, "members 3"]) -> Int[np.ndarray, " corners"] | None:
    """Return the boundary, edges of one triangle only; None if it is not a single ring."""
    ends = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()
    inner = {(end, start) for start, end in ends}
    following: dict[int, int] = {}
    for start, end in ends:
        if (start, end) in inner:
            continue
        if start in following:
            return None
        following[start] = end
    start = next(iter(following))
    ring = [start]
    while (here := following.get(ring[-1], start)) != start:
        if len(ring) > len(following):
            return None
        ring.append(here)
    return np.array(ring) if len(ring) == len(following) else None


def _convex(
    ring: Float[np.ndarray, "corners 3"], normal: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "fewer 3"] | None:
    """Drop corners on straight edges; None if the polygon is not convex."""
    corners = ring
    while len(corners) > 3:
        apart = _beyond_chord(corners, normal)
        least = int(np.argmin(np.abs(apart)))
        if abs(apart[least]) > STRAIGHT:
            break
        corners = np.delete(corners, least, axis=0)
    return corners if np.all(_beyond_chord(corners, normal) > 0) else None


def _beyond_chord(
    corners: Float[np.ndarray, "corners 3"], normal: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, " corners"]:
    """Distance of each corner outside the line between its neighbours, inside negative [m]."""
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    chord = after - before
    length = np.linalg.norm(chord, axis=-1)
    turn = np.cross(corners - before, chord) @ normal
    return np.asarray(np.divide(turn, length, out=np.zeros_like(turn), where=length > 0))


def _fan(corners: Float[np.ndarray, "corners 3"]) -> Float[np.ndarray, "quads 4 3"]:
    """Divide a convex polygon into quadrilaterals that share its first corner."""
    last = len(corners) - 1
    picks = [(0, one, one + 1, min(one + 2, last)) for one in range(1, last, 2)]
    return np.asarray(corners[np.array(picks)])
