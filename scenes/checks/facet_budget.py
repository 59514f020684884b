"""The number of facets that a scenario needs, and the check that they fit into memory."""

import math
from collections.abc import Mapping

import numpy as np

from scenes.meshes.mesh_file import placed_mesh
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate, largest_size, smallest_size
from scenes.schema.roughness import LARGEST_RELATIVE_RMS
from scenes.surfaces.facet_spacing import (
    BYTES_PER_FACET,
    MOST_BYTES,
    facet_count,
    facet_spacing,
    mesh_facet_count,
)
from scenes.surfaces.level_of_detail import flat_and_smooth


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
    mirrors_longer_than: float | None = None,
) -> list[str]:
    """Find impossible roughness parameters, and objects whose facets do not fit into memory.

    Parameters
    ----------
    objects
        By name.
    shortest_wavelength
        At the highest frequency of the radio. [m]
    flat
        Whether the scene has two dimensions, so that meshes become lines.
    mirrors_longer_than
        The longest wavelength, where smooth flat bodies need no facets
        (:mod:`scenes.surfaces.level_of_detail`); None where they do. [m]

    Returns
    -------
    A line for each problem, with the keys, the values, the limit and the remedy.
    """
    found = []
    for name, body in objects.items():
        if not isinstance(body, MeshFile):
            found += _roughness_problems(name, body)
    counted = dict(objects)
    if mirrors_longer_than is not None:
        counted = {
            name: body
            for name, body in objects.items()
            if not flat_and_smooth(body, mirrors_longer_than)
        }
    counts = facet_counts(counted, shortest_wavelength, flat=flat)
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
