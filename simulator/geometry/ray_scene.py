"""The scene for ray tests: a Sionna RT scene of the scenario's surfaces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from jaxtyping import Bool, Float

from estimator.compute import engine
from scenes.realisations.object_surface import Surface
from simulator.geometry.facets import Facets

mi.set_variant(engine.mitsuba_variant())

import sionna.rt as rt  # noqa: E402  the variant has to be chosen first

CLEARANCE = 2e-6
"""Least distance of a ray's start from its facet: 2 µm are negligible at wavelengths of a
millimetre. [m]"""

CLEARANCE_OF_EXTENT = 2e-6
"""The same relative to the farthest coordinate from the scene's centre: 17 roundings of single
precision; vertices, the ray's start and its direction cost about one each, the intersection some
more (C. Wächter and N. Binder, "A fast and robust method for avoiding self-intersection", 2019,
doi:10.1007/978-1-4842-4427-2_6, use offsets in proportion to coordinates, too). [-]"""

HALF_HEIGHT = 0.05
"""Half the height of the strips that represent line facets; rays run at z = 0. [m]"""

RAYS_AT_ONCE = 4_000_000
"""Rays traced in one batch: about 300 MB of single-precision rays. [-]"""


@dataclass(frozen=True)
class RayScene:
    """Surfaces that rays are tested against, in coordinates about their own centre.

    Rays are traced in single precision, whose resolution is relative to a coordinate: in
    coordinates about the centre it does not depend on where the scene is in the world.
    """

    scene: rt.Scene
    centre: Float[np.ndarray, " 3"]  # of the box around all surfaces [m]
    clearance: float  # least distance of a ray's ends from a surface [m]

    @property
    def objects(self) -> Mapping[str, rt.SceneObject]:
        """Surfaces by name, about the centre."""
        objects: Mapping[str, rt.SceneObject] = self.scene.objects
        return objects

    def about_centre(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Return points of the world in the scene's own coordinates [m]."""
        return np.asarray(points - self.centre)


def build_scene(surfaces: Sequence[Surface], *, mean: bool = False) -> RayScene:
    """Build the scene for ray tests; each surface becomes an object of its name.

    Parameters
    ----------
    surfaces
        Lines become upright strips.
    mean
        Whether surfaces are built without roughness.

    Raises
    ------
    ValueError
        If two surfaces have one name.
    """
    if mean:
        surfaces = [replace(surface, vertices=surface.mean_vertices) for surface in surfaces]
    points = np.concatenate([np.zeros((0, 3)), *(surface.vertices for surface in surfaces)])
    centre, extent = np.zeros(3), 0.0
    if len(points):
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        extent = float(np.abs(points - centre).max())
    return RayScene(
        scene=_scene(surfaces, centre, HALF_HEIGHT),
        centre=centre,
        clearance=max(CLEARANCE, CLEARANCE_OF_EXTENT * extent),
    )


def sionna_rt_scene(
    surfaces: Sequence[Surface],
    *,
    materials: Mapping[str, rt.RadioMaterial],
    frequency: float,
    half_height: float = HALF_HEIGHT,
) -> rt.Scene:
    """Build a Sionna RT scene in the world's coordinates, for Sionna's own solvers.

    Parameters
    ----------
    surfaces
        Lines become upright strips.
    materials
        Radio material of each surface, by the surface's name.
    frequency
        Of the scene; sets the materials' parameters. [Hz]
    half_height
        Half the height of the strips. [m]

    Raises
    ------
    ValueError
        If two surfaces have one name.
    """
    scene = _scene(surfaces, np.zeros(3), half_height)
    scene.frequency = frequency
    if surfaces:
        # Materials come after the frequency: they may be unknown at Sionna's default one.
        for one in scene.objects.values():
            one.radio_material = materials[one.mi_mesh.id()]
        scene.remove("/conductor")
    return scene


def _scene(
    surfaces: Sequence[Surface], centre: Float[np.ndarray, " 3"], half_height: float
) -> rt.Scene:
    """Build a scene with all surfaces conducting: ray tests need no materials."""
    names = [surface.name for surface in surfaces]
    if len(set(names)) < len(names):
        raise ValueError(f"surfaces {names}: each needs a name of its own; rename some")
    # Sionna's own 'metal' ends at 100 GHz; its constants serve for a conductor at any frequency.
    # Its name shares the objects' name space; no object's name holds a slash.
    metal = rt.RadioMaterial("/conductor", relative_permittivity=1.0, conductivity=1e7)
    meshes = {surface.name: _mesh(surface, centre, half_height) for surface in surfaces}
    for mesh in meshes.values():
        mesh.set_bsdf(metal)
    return rt.Scene(_traced(meshes))


def _traced(meshes: Mapping[str, mi.Mesh]) -> Any:
    """Build a Mitsuba scene with watertight intersection tests.

    For rays exactly through an edge, Embree's fast test misses one in nine; its robust one misses
    none and takes as long. OptiX (the CUDA backend) has no such option.
    """
    options: dict[str, Any] = {"type": "scene"}
    if not str(mi.variant()).startswith("cuda"):
        options["embree_use_robust_intersections"] = True
    # Our names might equal keys of Mitsuba's dictionary, so they are set afterwards.
    scene = mi.load_dict(options | {f"mesh{n}": mesh for n, mesh in enumerate(meshes.values())})
    for name, mesh in meshes.items():
        mesh.set_id(name)
    return scene


def _mesh(surface: Surface, centre: Float[np.ndarray, " 3"], half_height: float) -> mi.Mesh:
    vertices, faces = surface.vertices - centre, surface.cells
    if faces.shape[1] == 2:
        vertices, faces = _extruded(vertices, faces, half_height)
    elif len(surface.screens):
        faces = np.concatenate([faces, surface.screens])
    mesh = mi.Mesh(surface.name, vertex_count=len(vertices), face_count=len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(vertices.ravel().astype(np.float32))
    parameters["faces"] = mi.UInt32(faces.ravel().astype(np.uint32))
    parameters.update()
    return mesh


def _extruded(
    vertices: Float[np.ndarray, "vertices 3"], lines: np.ndarray, half_height: float
) -> tuple[np.ndarray, np.ndarray]:
    count = len(vertices)
    up = np.array([0.0, 0.0, half_height])
    first, second = lines.T
    lower = np.stack([first, second, second + count], axis=-1)
    upper = np.stack([first, second + count, first + count], axis=-1)
    return np.concatenate([vertices - up, vertices + up]), np.concatenate([lower, upper])


def facets_visible(
    rays: RayScene, facets: Facets, points: Float[np.ndarray, "points 3"]
) -> Bool[np.ndarray, "points facets"]:
    """Return which facets each point sees, by a ray from just off the facet to the point."""
    visible = np.empty((len(points), facets.count), dtype=bool)
    if not rays.objects or facets.count == 0:
        visible[:] = True
        return visible
    points = rays.about_centre(points)
    centres, normals = _double(rays.about_centre(facets.places)), _double(facets.mean_normals)
    chunk = max(1, RAYS_AT_ONCE // facets.count)
    for first in range(0, len(points), chunk):
        some = points[first : first + chunk]
        if len(some) == 1:  # no lookup needed
            centre, normal, end = centres, normals, _place(some[0])
        else:
            ray = dr.arange(mi.UInt32, len(some) * facets.count)
            point = ray // facets.count
            facet = ray - point * facets.count
            centre, normal, end = (
                mi.Vector3d(*(dr.gather(mi.Float64, axis, index) for axis in values))
                for values, index in ((centres, facet), (normals, facet), (_double(some), point))
            )
        seen = ~_shadowed(rays, centre, normal, end)
        visible[first : first + chunk] = np.asarray(seen.numpy()).reshape(len(some), facets.count)
    return visible


def _shadowed(rays: RayScene, centre: Any, normal: Any, end: Any) -> Any:
    """Trace from just off the facets; rays are made in double and traced in single precision."""
    side = dr.select(dr.dot(end - centre, normal) > 0.0, mi.Float64(1.0), mi.Float64(-1.0))
    start = centre + rays.clearance * side * normal
    along = end - start
    length = dr.norm(along)
    ray: Any = mi.Ray3f(mi.Point3f(start), mi.Vector3f(along / length))
    ray.maxt = mi.Float(length - rays.clearance)
    hit = rays.scene.mi_scene.ray_test(ray)
    dr.eval(hit)  # while the scene lives: read later, the result crashes
    return hit


def _double(values: Float[np.ndarray, "*n 3"]) -> Any:
    return mi.Vector3d(*(mi.Float64(np.ascontiguousarray(values[:, axis])) for axis in range(3)))


def _place(point: Float[np.ndarray, " 3"]) -> Any:
    # An opaque value, not a literal: one compiled kernel serves all points.
    return mi.Vector3d(*(dr.opaque(mi.Float64, float(value)) for value in point))


def blocked(
    rays: RayScene,
    starts: Float[np.ndarray, "*rays 3"],
    ends: Float[np.ndarray, "*rays 3"],
) -> Bool[np.ndarray, "*rays"]:
    """Return which straight segments meet a surface, by Mitsuba's ``ray_test``."""
    shape = starts.shape[:-1]
    if not rays.objects or 0 in shape:
        return np.zeros(shape, dtype=bool)
    starts, along = rays.about_centre(starts), ends - starts
    lengths = np.linalg.norm(along, axis=-1)
    directions = along / lengths[..., None]
    ray: Any = mi.Ray3f(_single(starts, mi.Point3f), _single(directions, mi.Vector3f))
    ray.maxt = mi.Float((lengths - rays.clearance).ravel().astype(np.float32))
    hit = rays.scene.mi_scene.ray_test(ray)
    dr.eval(hit)  # while the scene lives: read later, the result crashes
    return np.asarray(hit.numpy(), dtype=bool).reshape(shape)


def _single(values: Float[np.ndarray, "*rays 3"], kind: Any) -> Any:
    return kind(*(mi.Float(values[..., axis].ravel().astype(np.float32)) for axis in range(3)))
