"""The scene that rays are traced in: a Sionna RT scene of the scenario's surfaces."""

from collections.abc import Mapping, Sequence
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
"""How far from its facet a ray starts: single precision places a vertex at 1 m within
0.1 µm, and 2 µm hides nothing that scatters at a millimetre's wavelength. [m]"""

HALF_HEIGHT = 0.05
"""Half the height of the strips that stand for line facets; rays run at z = 0. [m]."""

RAYS_AT_ONCE = 4_000_000
"""Rays traced in one go: about 300 MB of single-precision rays."""


def build_scene(
    surfaces: Sequence[Surface],
    *,
    materials: Mapping[str, rt.RadioMaterial] | None = None,
    frequency: float | None = None,
    half_height: float = HALF_HEIGHT,
) -> rt.Scene:
    """Build a Sionna RT scene; each surface becomes an object of its name.

    Parameters
    ----------
    surfaces
        Lines become upright strips.
    materials
        Radio material of each surface, by the surface's name; without, all are conductors,
        which does for rays that only ask what they meet.
    frequency
        Of the scene, to which materials adapt; Sionna's own default without. [Hz]
    half_height
        Half the height of the strips. [m]

    Raises
    ------
    ValueError
        If two surfaces have one name.
    """
    names = [surface.name for surface in surfaces]
    if len(set(names)) < len(names):
        raise ValueError(f"surfaces {names}: each needs a name of its own; rename some")
    # Sionna's own 'metal' ends at 100 GHz; its constants do for a conductor at any frequency.
    # Its name is in the objects' name space, and none of theirs holds a slash.
    metal = rt.RadioMaterial("/conductor", relative_permittivity=1.0, conductivity=1e7)
    meshes = {surface.name: _mesh(surface, half_height) for surface in surfaces}
    for mesh in meshes.values():
        mesh.set_bsdf(metal)
    scene = rt.Scene(_traced(meshes))
    if frequency is not None:
        scene.frequency = frequency
    if materials is not None and meshes:
        # Only now, since a material may be unknown at the frequency that Sionna begins with.
        for one in scene.objects.values():
            one.radio_material = materials[one.mi_mesh.id()]
        scene.remove("/conductor")
    return scene


def _traced(meshes: Mapping[str, mi.Mesh]) -> Any:
    """Make a Mitsuba scene in which no ray slips through between two triangles.

    Of rays that pass exactly through an edge, Embree's quick test misses one in nine; its robust
    one misses none and takes as long. OptiX (the CUDA backend) has no such choice.
    """
    options: dict[str, Any] = {"type": "scene"}
    if not str(mi.variant()).startswith("cuda"):
        options["embree_use_robust_intersections"] = True
    # Names of ours may be keys of Mitsuba's, so they are given afterwards.
    scene = mi.load_dict(options | {f"mesh{n}": mesh for n, mesh in enumerate(meshes.values())})
    for name, mesh in meshes.items():
        mesh.set_id(name)
    return scene


def _mesh(surface: Surface, half_height: float) -> mi.Mesh:
    vertices, faces = surface.vertices, surface.cells
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
    scene: rt.Scene, facets: Facets, points: Float[np.ndarray, "points 3"]
) -> Bool[np.ndarray, "points facets"]:
    """Tell which facets each point sees, by a ray from just off the facet to the point."""
    visible = np.empty((len(points), facets.count), dtype=bool)
    if not scene.objects or facets.count == 0:
        visible[:] = True
        return visible
    # Far from the origin, single precision places vertices more coarsely.
    rounding = 4 * float(np.finfo(np.float32).eps) * float(np.abs(facets.centres).max(initial=0.0))
    clearance = max(CLEARANCE, rounding)
    centres, normals = (_double(values) for values in (facets.centres, facets.normals))
    chunk = max(1, RAYS_AT_ONCE // facets.count)
    for first in range(0, len(points), chunk):
        some = points[first : first + chunk]
        if len(some) == 1:  # no need to look anything up
            centre, normal, end = centres, normals, _place(some[0])
        else:
            ray = dr.arange(mi.UInt32, len(some) * facets.count)
            point = ray // facets.count
            facet = ray - point * facets.count
            centre, normal, end = (
                mi.Vector3d(*(dr.gather(mi.Float64, axis, index) for axis in values))
                for values, index in ((centres, facet), (normals, facet), (_double(some), point))
            )
        seen = ~_shadowed(scene, centre, normal, end, clearance)
        visible[first : first + chunk] = np.asarray(seen.numpy()).reshape(len(some), facets.count)
    return visible


def _shadowed(scene: rt.Scene, centre: Any, normal: Any, end: Any, clearance: float) -> Any:
    """Trace from just off the facets; rays are made in double and traced in single precision."""
    side = dr.select(dr.dot(end - centre, normal) > 0.0, mi.Float64(1.0), mi.Float64(-1.0))
    start = centre + clearance * side * normal
    along = end - start
    length = dr.norm(along)
    ray: Any = mi.Ray3f(mi.Point3f(start), mi.Vector3f(along / length))
    ray.maxt = mi.Float(length - CLEARANCE)
    hit = scene.mi_scene.ray_test(ray)
    dr.eval(hit)  # while the scene lives: read later, the result crashes
    return hit


def _double(values: Float[np.ndarray, "*n 3"]) -> Any:
    return mi.Vector3d(*(mi.Float64(np.ascontiguousarray(values[:, axis])) for axis in range(3)))


def _place(point: Float[np.ndarray, " 3"]) -> Any:
    # Opaque: the same kernel serves all points.
    return mi.Vector3d(*(dr.opaque(mi.Float64, float(value)) for value in point))


def blocked(
    scene: rt.Scene,
    starts: Float[np.ndarray, "*rays 3"],
    ends: Float[np.ndarray, "*rays 3"],
) -> Bool[np.ndarray, "*rays"]:
    """Tell which straight segments meet a surface, by Mitsuba's ``ray_test``."""
    shape = starts.shape[:-1]
    if not scene.objects or 0 in shape:
        return np.zeros(shape, dtype=bool)
    along = ends - starts
    lengths = np.linalg.norm(along, axis=-1)
    directions = along / lengths[..., None]
    ray: Any = mi.Ray3f(_single(starts, mi.Point3f), _single(directions, mi.Vector3f))
    ray.maxt = mi.Float((lengths - CLEARANCE).ravel().astype(np.float32))
    hit = scene.mi_scene.ray_test(ray)
    dr.eval(hit)  # while the scene lives: read later, the result crashes
    return np.asarray(hit.numpy(), dtype=bool).reshape(shape)


def _single(values: Float[np.ndarray, "*rays 3"], kind: Any) -> Any:
    return kind(*(mi.Float(values[..., axis].ravel().astype(np.float32)) for axis in range(3)))
