"""Surfaces of a scenario's objects, cut into facets and displaced by frozen roughness.

Line cells (2-D scenes) run so that the normal of a cell from v0 to v1, with (dx, dy) = v1 - v0,
is (dy, -dx)/|v1 - v0|: to the right, seen along the cell. Closed contours run counter-clockwise,
so this is outward; on a plate it is the plate's ``normal``. Triangles (3-D scenes) are wound
counter-clockwise as seen from outside, or from the side of the plate's ``normal``.

How heights displace the mean shape: along the normal of a plate; radially on a cylinder, with
a profile that closes on itself; on a box, and at the ends of a 3-D cylinder, face by face.
Where two faces meet, both displace the common edge, each along its own normal, and either face
is stretched along itself to reach it, within ten correlation lengths of the edge. So closed
shapes stay closed, and no height is tapered.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from scenes.random_streams import random_stream
from scenes.scenario import Scenario, ScenarioError
from scenes.schema.errors import did_you_mean
from scenes.schema.materials import Slab
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate
from scenes.schema.roughness import Roughness
from scenes.surfaces.facet_spacing import BYTES_PER_FACET, MOST_BYTES, facet_count
from scenes.surfaces.heights import Heights
from scenes.surfaces.primitives import in_reach, shape_in_reach, upright_shape
from scenes.surfaces.tiled_faces import Reach


@dataclass(frozen=True, kw_only=True)
class Surface:
    """One object's surface: a frozen realisation, the same from every antenna."""

    name: str
    material: str | Slab
    vertices: Float[np.ndarray, "vertices 3"]  # displaced by the roughness [m]
    mean_vertices: Float[np.ndarray, "vertices 3"]  # of the smooth shape [m]
    cells: Int[np.ndarray, "cells corners"]  # indices: two per line, three per triangle
    closed: bool  # closed: only the outer side is seen; open: both sides
    screens: Int[np.ndarray, "screens 3"] = field(
        default_factory=lambda: np.empty((0, 3), dtype=np.int64)
    )  # triangles outside all antenna beams: they only block rays
    roughness: Roughness | None = None  # statistics of the heights; None: none are known


def object_surface(
    scenario: Scenario,
    name: str,
    *,
    seed: int,
    sample: int = 0,
    spacing: float | None = None,
    reach: Reach | None = None,
) -> Surface:
    """Cut an object of a scenario into facets and displace them by its roughness.

    Parameters
    ----------
    scenario, name
        The scenario and the name of the object in it.
    seed, sample
        Which realisation; its random stream is ``"roughness/<name>"``.
    spacing
        Largest distance of neighbouring vertices; infinity makes the coarsest surface. By
        default, what the object needs (:meth:`Scenario.facet_spacing`). [m]
    reach
        Where facets are needed, in 3-D only; without, all over the object.

    Raises
    ------
    ScenarioError
        If there is no such object, or its facets would not fit into memory.
    ValueError
        If the spacing is not positive.
    """
    if name not in scenario.objects:
        raise ScenarioError(
            f"objects.{name}: no such object{did_you_mean(name, scenario.objects)}; "
            f"known: {', '.join(scenario.objects) or 'none'}"
        )
    body = scenario.objects[name]
    if spacing is None:
        spacing = scenario.facet_spacing(name)
    if not spacing > 0:
        raise ValueError(f"spacing = {spacing} m must be positive; give a length")
    body = body.frozen or body  # its heights are in the mesh, and it is smooth by itself
    heights = Heights(body.roughness, random_stream(seed, sample, f"roughness/{name}"))
    if isinstance(body, MeshFile):
        if scenario.dimensions == 2:
            from scenes.surfaces.mesh_section_2d import lines_are_closed, mesh_lines

            shape = mesh_lines(body, spacing, heights)
            closed = not body.hollow and lines_are_closed(shape.cells)
        else:
            from scenes.surfaces.mesh_refinement import mesh_is_closed, mesh_surface

            shape, closed = mesh_surface(body, spacing, heights), mesh_is_closed(body)
            shape = shape if reach is None else in_reach(shape, reach)
    elif reach is not None:
        shape = shape_in_reach(body, spacing, heights, reach)
        closed = not isinstance(body, Plate)
    else:
        _refuse_too_many(name, body, spacing)
        shape, closed = upright_shape(body, spacing, heights), not isinstance(body, Plate)
    return Surface(
        name=name,
        material=body.material,
        vertices=shape.vertices,
        mean_vertices=shape.mean_vertices,
        cells=shape.cells,
        closed=closed,
        screens=shape.screens,
        roughness=body.roughness,
    )


def plate_segment(plate: Plate) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return the ends of a plate's mean line, in the order of its tangent [m]."""
    half = plate.length_m / 2 * plate.tangent
    return plate.centre - half, plate.centre + half


def _refuse_too_many(name: str, body: Plate | Cylinder | Box, spacing: float) -> None:
    count = facet_count(body, spacing)
    if count * BYTES_PER_FACET > MOST_BYTES:
        raise ScenarioError(
            f"objects.{name}: {count:.3g} facets at a spacing of {spacing * 1e3:.3g} mm need "
            f"{count * BYTES_PER_FACET / 2**30:.3g} GiB, more than {MOST_BYTES >> 30} GiB; "
            "give a larger spacing"
        )
