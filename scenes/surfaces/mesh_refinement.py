"""Meshes from files as facets: edges cut until they are short, flat faces made rough.

A rough mesh consists of flat faces (groups of coplanar triangles), each with heights of its
own. A vertex on an edge between faces is displaced so that it lies on all of them (least
squares), so the mesh stays as closed as it was; across an edge of less than 25° it takes
their mean.
"""

import numpy as np
from jaxtyping import Float, Int

from scenes.meshes.mesh_file import placed_mesh
from scenes.meshes.triangle_mesh import TriangleMesh
from scenes.schema.errors import ScenarioError
from scenes.schema.objects import MeshFile
from scenes.surfaces.facet_spacing import BYTES_PER_FACET, MOST_BYTES, mesh_facet_count
from scenes.surfaces.heights import Heights
from scenes.surfaces.shape import Shape

FLAT = 1e-4
"""Largest angle between coplanar triangles: 10 µm over 10 cm [rad]."""

SHARPEST_MEAN = 0.05
"""Ratio tan²(θ/2) of an edge's angle θ below which two faces count as one: θ = 25° [-]."""


def mesh_is_closed(body: MeshFile) -> bool:
    """Tell whether a mesh is a watertight solid, so that only its outer side is seen."""
    return not body.hollow and placed_mesh(body).is_watertight


def mesh_surface(body: MeshFile, spacing: float, heights: Heights) -> Shape:
    """Cut a mesh into triangles with edges of at most ``spacing``, displaced by the heights.

    Raises
    ------
    ScenarioError
        If it would not fit into memory, or a rough mesh has faces too small to be rough.
    """
    mesh = placed_mesh(body)
    if body.facets == "file":
        return Shape(vertices=mesh.vertices, mean_vertices=mesh.vertices, cells=mesh.faces)
    count = mesh_facet_count(mesh.area, len(mesh.faces), spacing)
    if count * BYTES_PER_FACET > MOST_BYTES:
        raise ScenarioError(
            f"mesh file {body.file!r}: {count:.3g} facets at a spacing of {spacing * 1e3:.3g} mm "
            f"need {count * BYTES_PER_FACET / 2**30:.3g} GiB, more than {MOST_BYTES >> 30} GiB; "
            "give a larger spacing"
        )
    vertices, faces = mesh.vertices, mesh.faces
    if heights.smooth:
        mean, cells, _ = refined(vertices, faces, np.zeros(len(faces), dtype=np.int64), spacing)
        return Shape(vertices=mean, mean_vertices=mean, cells=cells)
    patches = flat_patches(mesh)
    _refuse_small(body, mesh, patches, heights.longest)
    mean, cells, patches = refined(vertices, faces, patches, spacing)
    return Shape(
        vertices=mean + _displacements(mean, cells, patches, heights),
        mean_vertices=mean,
        cells=cells,
    )


def refined(
    vertices: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "faces 3"],
    labels: Int[np.ndarray, " faces"],
    longest: float,
) -> tuple[
    Float[np.ndarray, "new_vertices 3"],
    Int[np.ndarray, "new_faces 3"],
    Int[np.ndarray, " new_faces"],
]:
    """Halve the edges of a mesh until none is longer than ``longest``.

    An edge is halved for both its triangles or for neither, so a watertight mesh stays so.

    Returns
    -------
    Vertices, triangles, and for each triangle the label of the one it was cut from.
    """
    while True:
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=-1).reshape(-1, 2)
        keys, edge_of = np.unique(edges @ [len(vertices), 1], return_inverse=True)
        unique = np.stack(np.divmod(keys, len(vertices)), axis=-1)
        lengths = np.linalg.norm(vertices[unique[:, 0]] - vertices[unique[:, 1]], axis=-1)
        halved = lengths > longest
        if not halved.any():
            return vertices, faces, labels
        middle = np.full(len(keys), -1)
        middle[halved] = len(vertices) + np.arange(np.count_nonzero(halved))
        vertices = np.concatenate([vertices, vertices[unique[halved]].mean(axis=1)])
        faces, labels = _cut(faces, labels, middle[edge_of].reshape(-1, 3))


def _cut(
    faces: Int[np.ndarray, "faces 3"],
    labels: Int[np.ndarray, " faces"],
    middles: Int[np.ndarray, "faces 3"],
) -> tuple[Int[np.ndarray, "new_faces 3"], Int[np.ndarray, " new_faces"]]:
    """Cut triangles at the middles of their edges 01, 12, 20 (-1: this edge stays whole)."""
    # Turn each triangle so that its pattern of halved edges is (), (01), (01, 12) or all three.
    cut = middles >= 0
    count = cut.sum(axis=1)
    first = np.where(count == 1, cut.argmax(axis=1), 0)
    first = np.where(count == 2, (cut.argmin(axis=1) + 1) % 3, first)
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, turn, axis=1).T
    patterns = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(ab, b, bc), (a, ab, c), (ab, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    parts = [
        (np.stack(corners, axis=-1)[count == halves], labels[count == halves])
        for halves, pieces in patterns.items()
        for corners in pieces
    ]
    return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])


def flat_patches(mesh: TriangleMesh) -> Int[np.ndarray, " faces"]:
    """Return, for each triangle of a mesh, the number of the flat face that it is part of."""
    from scipy.sparse import coo_matrix  # takes long to import
    from scipy.sparse.csgraph import connected_components

    one, other = np.moveaxis(mesh.normals[mesh.neighbours], 1, 0)
    cosines = np.einsum("px,px->p", one, other)
    angles = np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), cosines)
    pairs = mesh.neighbours[angles < FLAT]
    links = coo_matrix(
        (np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])),
        shape=(len(mesh.faces), len(mesh.faces)),
    )
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def _refuse_small(
    body: MeshFile,
    mesh: TriangleMesh,
    patches: Int[np.ndarray, " faces"],
    correlation_length: float,
) -> None:
    sizes = np.sqrt(np.bincount(patches, weights=mesh.areas))
    if sizes.min() < correlation_length:
        raise ScenarioError(
            f"mesh file {body.file!r}: a rough mesh needs flat faces larger than a correlation "
            f"length of {correlation_length * 1e3:.3g} mm, its smallest of {len(sizes)} is "
            f"{sizes.min() * 1e3:.3g} mm across; lower roughness.correlation_mm, use a plate, "
            "box or cylinder, or leave the mesh smooth"
        )


def _displacements(
    vertices: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "faces 3"],
    patches: Int[np.ndarray, " faces"],
    heights: Heights,
) -> Float[np.ndarray, "vertices 3"]:
    """Least squares of n·d = h over the patches that meet in each vertex."""
    normals, across = np.zeros((len(vertices), 3, 3)), np.zeros((len(vertices), 3))
    sharing = np.zeros(len(vertices), dtype=np.int64)
    order = np.argsort(patches, kind="stable")
    starts = np.flatnonzero(np.diff(patches[order], prepend=-1))
    for members in np.split(faces[order], starts[1:]):
        a, b, c = vertices[members[0]]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        first = (b - a) / np.linalg.norm(b - a)
        plane = np.stack([first, np.cross(normal, first)], axis=-1)
        corners = np.unique(members)
        height = heights.at((vertices[corners] - a) @ plane)
        normals[corners] += np.outer(normal, normal)
        across[corners] += height[:, None] * normal
        sharing[corners] += 1
    edge = sharing > 1  # elsewhere d = h n already
    inverse = np.linalg.pinv(normals[edge], rcond=SHARPEST_MEAN, hermitian=True)
    across[edge] = np.einsum("vij,vj->vi", inverse, across[edge])
    return across
