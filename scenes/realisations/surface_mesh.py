"""Surfaces as triangle meshes for other programs: Mitsuba, Sionna, Blender."""

import numpy as np
import trimesh

from scenes.realisations.object_surface import Surface


def surface_to_mesh(surface: Surface, *, extrude: float | None) -> trimesh.Trimesh:
    """Return a triangle mesh of a surface, displaced by its roughness.

    Parameters
    ----------
    surface
        The surface; its line cells become upright strips.
    extrude
        Height of the strips, half of it below z = 0; None for a surface of triangles. [m]

    Returns
    -------
    The mesh; ``mesh.export("wall.ply")`` writes it, in single precision. Its normals point as
    those of the cells. Strips have no lid at top and bottom.

    Raises
    ------
    ValueError
        If line cells lack a positive height, or triangles are given one.
    """
    vertices, cells = surface.vertices, surface.cells
    if cells.shape[1] == 3:
        if extrude is not None:
            raise ValueError(
                f"surface {surface.name!r} has triangles and cannot be extruded by {extrude} m; "
                "leave extrude = None"
            )
        return trimesh.Trimesh(vertices=vertices, faces=cells, process=False)
    if extrude is None or not (np.isfinite(extrude) and extrude > 0):
        raise ValueError(
            f"surface {surface.name!r} is a line: extrude = {extrude} m must be a positive "
            "height; give one, such as 0.1"
        )
    half = np.array([0.0, 0.0, extrude / 2])
    first, second = cells.T
    count = len(vertices)
    faces = np.concatenate(
        [
            np.stack([first, second, second + count], axis=-1),
            np.stack([first, second + count, first + count], axis=-1),
        ]
    )
    return trimesh.Trimesh(
        vertices=np.concatenate([vertices - half, vertices + half]), faces=faces, process=False
    )
