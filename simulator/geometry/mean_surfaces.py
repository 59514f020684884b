"""The smooth mean surfaces of a scenario's objects, and the flat mirrors among them."""

import numpy as np
from jaxtyping import Float

from scenes.meshes.triangle_mesh import TriangleMesh
from scenes.realisations.object_surface import Surface, object_surface
from scenes.scenario import Scenario
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate
from scenes.surfaces.level_of_detail import flat_and_smooth
from simulator.geometry.flat_faces import flat_faces
from simulator.geometry.mirrors import Mirrors, line_mirrors
from simulator.materials.fresnel_slab import Absorber, Conductor, Material

MOST_FACES = 64
"""Most flat faces of a mesh whose faces are mirrors; beyond, it counts as curved, because the
number of chains grows as a power of the number of mirrors, unless it is smooth and its faces are
wide (:mod:`scenes.surfaces.level_of_detail`). [-]"""

_SAME_PLANE = 1e-9  # largest distance between the planes of a rectangle's two triangles [m]
_SAME_NORMAL = 1e-12  # largest 1 - cosine between their normals: 1.4 µrad; rounding is 1e-16 [-]


def mean_surfaces(scenario: Scenario) -> list[Surface]:
    """Divide a scenario's objects into the fewest facets, without their roughness."""
    smooth = scenario.model_copy(
        update={
            "objects": {
                name: body.model_copy(update={"roughness": None, "realisation": None})
                for name, body in scenario.objects.items()
            }
        }
    )
    return [object_surface(smooth, name, seed=0, spacing=np.inf) for name in smooth.objects]


def rms_height(scenario: Scenario, name: str) -> float:
    """Return the rms height of an object's surface, 0 if it is smooth [m]."""
    rough = scenario.objects[name].roughness
    return 0.0 if rough is None else rough.rms


def mean_mirrors(
    scenario: Scenario, surfaces: list[Surface], materials: dict[str, Material]
) -> Mirrors:
    """Make mirrors of the flat mean surfaces of a scenario.

    Parameters
    ----------
    scenario
        Its cylinders and curved meshes are not mirrors: the image method needs planes.
    surfaces
        Its objects' smooth surfaces, of the fewest facets.
    materials
        The objects' materials; absorbers are not mirrors either.
    """
    corners, made, rough, two_sided = [np.empty((0, 4, 3))], [], [], []
    for surface in surfaces:
        body, material = scenario.objects[surface.name], materials[surface.name]
        if isinstance(body, Cylinder) or isinstance(material, Absorber):
            continue
        if isinstance(body, MeshFile) and surface.cells.shape[1] == 3:
            flat = flat_faces(TriangleMesh(vertices=surface.vertices, faces=surface.cells))
        else:
            flat = _flat_mirrors(surface)
        if (
            isinstance(body, MeshFile)
            and len(flat) > MOST_FACES
            and not flat_and_smooth(body, scenario.radio.longest_wavelength)
        ):
            continue
        if isinstance(body, Plate | Box) and surface.cells.shape[1] == 3:
            flat = _quadrilaterals(flat)
        corners.append(flat)
        made += [material] * len(flat)
        rough += [body.roughness.rms if body.roughness is not None else 0.0] * len(flat)
        two_sided += [not surface.closed] * len(flat)
    return Mirrors(
        corners=np.concatenate(corners),
        materials=tuple(made),
        rms_heights=np.array(rough, dtype=np.float64),
        two_sided=np.array(two_sided, dtype=bool),
    )


def _flat_mirrors(surface: Surface) -> Float[np.ndarray, "mirrors 4 3"]:
    points = surface.vertices[surface.cells]
    count = len(points)
    if surface.cells.shape[1] == 3:
        return np.concatenate([points, points[:, 2:]], axis=1)
    return line_mirrors(
        points[:, 0],
        points[:, 1],
        materials=[Conductor()] * count,
        rms_heights=np.zeros(count),
        two_sided=np.ones(count, dtype=bool),
    ).corners


def _quadrilaterals(
    triangles: Float[np.ndarray, "triangles 4 3"],
) -> Float[np.ndarray, "mirrors 4 3"]:
    """Join the two triangles of each rectangle to one mirror."""
    corners = triangles[:, :3]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    found = []
    left = list(range(len(corners)))
    while left:
        first = left.pop(0)
        offset = [float(across[first] @ (corners[k, 0] - corners[first, 0])) for k in left]
        same = [
            k
            for k, height in zip(left, offset, strict=True)
            if abs(height) < _SAME_PLANE and across[first] @ across[k] > 1 - _SAME_NORMAL
        ]
        second = same[0]
        left.remove(second)
        # The corner of the second triangle that the first one lacks.
        apart = [
            min(float(np.linalg.norm(corner - other)) for other in corners[first])
            for corner in corners[second]
        ]
        extra = corners[second][int(np.argmax(apart))]
        # It lies opposite the first triangle's corner that is farthest from it.
        farthest = int(np.argmax(np.linalg.norm(corners[first] - extra, axis=-1)))
        a, b, c = np.roll(corners[first], -farthest, axis=0)
        found.append(np.stack([a, b, extra, c]))
    return np.array(found)
