"""How finely a surface must be cut into facets, and how many facets that makes."""

import math
from collections.abc import Mapping

import numpy as np

from scenes.meshes.mesh_file import placed_mesh
from scenes.schema.objects import (
    LARGEST_RELATIVE_RMS,
    Body,
    Box,
    Cylinder,
    MeshFile,
    Plate,
    largest_size,
    smallest_size,
)

FACETS_PER_WAVELENGTH = 4
"""Facets per shortest wavelength: the phase turns by at most π over one, there and back [-]."""

FACETS_PER_CORRELATION_LENGTH = 4
"""Facets per correlation length: resolves a Gaussian spectrum to 1e-12 of its peak [-]."""

FACETS_PER_CUTOFF = 2
"""Facets per inner cut-off: what an exponential spectrum has beyond is below e^(-π²) [-]."""

BYTES_PER_FACET = 128
"""What a facet takes: two vertices or their share, centre, normal, size, field [byte]."""

MOST_BYTES = 16 * 2**30
"""What the facets of a scenario may take in all [byte]."""

FEWEST_ROUND = 64
"""Fewest lines around a cylinder, however coarse the spacing: 6° each [-]."""


def facet_spacing(body: Body, shortest_wavelength: float) -> float:
    """Return the largest spacing of the vertices that keeps physical optics true [m].

    It is min(λ/4, l/4), with half the inner cut-off as a third limit for an exponential
    spectrum. An absorber scatters nothing and needs no facets: infinity.

    Parameters
    ----------
    body
        The object.
    shortest_wavelength
        At the highest frequency of the radio. [m]
    """
    if body.material == "absorber":
        return math.inf
    spacing = shortest_wavelength / FACETS_PER_WAVELENGTH
    rough = body.roughness
    if rough is not None and rough.rms > 0:
        spacing = min(spacing, rough.correlation_length / FACETS_PER_CORRELATION_LENGTH)
        if rough.inner_cutoff > 0:
            spacing = min(spacing, rough.inner_cutoff / FACETS_PER_CUTOFF)
    return spacing


def steps(length: float, spacing: float) -> int:
    """Count the equal steps of at most ``spacing`` in ``length``; at least one."""
    # A length that is a whole number of steps must not gain one by rounding.
    return max(1, math.ceil(length / spacing * (1 - 1e-12)))


def steps_round(radius: float, spacing: float) -> int:
    """Count the equal steps of at most ``spacing`` around a circle."""
    return max(FEWEST_ROUND, steps(2 * math.pi * radius, spacing))


def facet_count(body: Plate | Cylinder | Box, spacing: float) -> int:
    """Count the facets of a surface: lines in 2-D (no height), triangles in 3-D."""
    height = body.height_m
    match body:
        case Plate():
            along = steps(body.length_m, spacing)
            return along if height is None else 2 * along * steps(height, spacing)
        case Cylinder():
            around = steps_round(body.radius_m, spacing)
            if height is None:
                return around
            rings = steps(body.radius_m, spacing)
            side = 2 * around * steps(height, spacing)
            return side + 2 * around * (2 * rings - 1)
        case Box():
            along, across = steps(body.length_m, spacing), steps(body.depth_m, spacing)
            if height is None:
                return 2 * (along + across)
            up = steps(height, spacing)
            return 4 * (along * across + across * up + up * along)


def mesh_facet_count(area: float, faces: int, spacing: float) -> int:
    """Estimate the triangles of a mesh of that area with edges no longer than ``spacing``.

    Cutting edges in half until they are short enough leaves triangles of a half to a quarter
    of the largest area; the estimate takes the smaller.
    """
    return faces + math.ceil(4 * area / spacing**2)


def facet_counts(
    objects: Mapping[str, Plate | Cylinder | Box | MeshFile],
    shortest_wavelength: float,
    *,
    flat: bool = False,
) -> dict[str, int]:
    """Count the facets of whole objects, by name; parameters as in :func:`facet_problems`."""
    counts: dict[str, int] = {}
    for name, drawn in objects.items():
        spacing, body = facet_spacing(drawn, shortest_wavelength), drawn.frozen or drawn
        if not isinstance(body, MeshFile):
            counts[name] = facet_count(body, spacing)
        elif flat:
            counts[name] = _mesh_line_count(body, spacing)
        else:
            mesh = placed_mesh(body)
            counts[name] = len(mesh.faces)
            if body.facets == "cut":
                counts[name] = mesh_facet_count(mesh.area, len(mesh.faces), spacing)
    return counts


def facet_problems(
    objects: Mapping[str, Plate | Cylinder | Box | MeshFile],
    shortest_wavelength: float,
    *,
    flat: bool = False,
) -> list[str]:
    """Find rough surfaces that cannot be, and facets that would not fit into memory.

    Parameters
    ----------
    objects
        By name.
    shortest_wavelength
        At the highest frequency of the radio. [m]
    flat
        Whether the scene has two dimensions, so that meshes become lines.

    Returns
    -------
    A line for each problem, with the keys, the values, the limit and the remedy.
    """
    found = []
    for name, body in objects.items():
        if not isinstance(body, MeshFile):
            found += _roughness_problems(name, body)
    counts = facet_counts(objects, shortest_wavelength, flat=flat)
    needed = sum(counts.values()) * BYTES_PER_FACET
    if needed > MOST_BYTES:
        name = max(counts, key=lambda key: counts[key])
        spacing = facet_spacing(objects[name], shortest_wavelength)
        found.append(
            f"objects.{name}: needs {counts[name]:.3g} facets at a spacing of "
            f"{spacing * 1e3:.3g} mm, all objects {needed / 2**30:.3g} GiB, more than "
            f"{MOST_BYTES >> 30} GiB; make it smaller, lower radio.stop_ghz, or raise "
            f"objects.{name}.roughness.correlation_mm (or set roughness.rms_mm = 0: smooth)"
        )
    return found


def _mesh_line_count(body: MeshFile, spacing: float) -> int:
    from scenes.surfaces.mesh_section_2d import mesh_segments

    starts, ends = mesh_segments(body)
    if body.facets == "file":
        return len(starts)
    return len(starts) + math.ceil(float(np.linalg.norm(ends - starts, axis=-1).sum()) / spacing)


def _roughness_problems(name: str, body: Plate | Cylinder | Box) -> list[str]:
    rough = body.roughness
    if rough is None or rough.rms == 0:
        return []
    found = []
    highest = LARGEST_RELATIVE_RMS * smallest_size(body)
    if rough.rms > highest:
        found.append(
            f"objects.{name}.roughness.rms_mm = {rough.rms_mm}: must be at most "
            f"{highest * 1e3:.3g} mm, a tenth of the object's smallest size; lower it"
        )
    longest = largest_size(body)
    if rough.correlation_length > longest:
        found.append(
            f"objects.{name}.roughness.correlation_mm = {rough.correlation_mm}: must be at most "
            f"{longest * 1e3:.3g} mm, the object's largest size (around a cylinder: its radius); "
            "lower it"
        )
    return found
