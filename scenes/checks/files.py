"""Checks of the files that a scenario names: meshes, realisations, permittivity tables."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from scenes.meshes.mesh_file import placed_mesh
from scenes.schema.errors import ScenarioError
from scenes.schema.materials import Slab
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate
from scenes.schema.permittivity_table import band_problem, read_permittivity_table
from scenes.schema.roughness import Roughness
from scenes.surfaces.heights import Heights
from scenes.surfaces.mesh_section_2d import mesh_segments
from scenes.surfaces.primitives import upright_shape

HIGHEST = 10.0
"""Height, over the rms height, that a realisation may have: 1e12 Gaussian ones stay below 7. [-]"""

LONGEST_CHORD = 0.2  # longest edge round a cylinder's realisation, over its radius [-]

ROUNDED = 1e-6  # height that a file may give to a smooth surface [m]


def file_problems(
    objects: Mapping[str, Plate | Cylinder | Box | MeshFile],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    flat: bool,
) -> list[str]:
    """Find files that are missing, unreadable, or inconsistent with the object that names them.

    Parameters
    ----------
    objects
        By name.
    frequencies
        At which materials are needed. [Hz]
    flat
        Whether the scene has two dimensions, so that meshes become lines.

    Returns
    -------
    A line for each problem, with the key, the value, the limit and the remedy.
    """
    found = []
    for name, body in objects.items():
        for key, mesh in (("file", body), ("realisation", body.frozen)):
            if isinstance(mesh, MeshFile):
                try:
                    placed_mesh(mesh)
                    if flat:
                        mesh_segments(mesh)
                except ScenarioError as error:
                    found.append(f"objects.{name}.{key}: {error}")
        if not found and body.frozen is not None:
            found += _misplaced(name, body, body.frozen, flat=flat)
        if body.roughness is not None:
            found += _height_problems(name, body, body.roughness, flat=flat)
        if isinstance(body.material, Slab) and body.material.file is not None:
            found += _table_problems(name, Path(body.material.file), frequencies)
    return found


def _height_problems(
    name: str, body: Plate | Cylinder | Box | MeshFile, roughness: Roughness, *, flat: bool
) -> list[str]:
    """Find measured heights that do not fit the shape of an object, or are too few to cover it."""
    measured = roughness.measured
    if measured is None:
        return []
    key = f"objects.{name}.roughness.file = {roughness.file!r}"
    if isinstance(body, Cylinder):
        return [f"{key}: measured heights do not close round a cylinder; use a plate or a box"]
    if measured.profile and not flat:
        return [f"{key}: a single profile, and the scene has 3 dimensions; give a height map"]
    if roughness.repeat:
        return []
    if isinstance(body, MeshFile):
        return [f"{key}: a mesh's faces are not known beforehand; set roughness.repeat = true"]
    sides = [body.length_m, *([body.depth_m] if isinstance(body, Box) else [])]
    needed = [(side, 0.0) for side in sides]
    if body.height_m is not None:
        needed = [(side, body.height_m) for side in sides]
        needed += [(sides[0], sides[1])] if len(sides) == 2 else []
    extent = [measured.step * (count - 1) for count in measured.heights.shape]
    for face in needed:
        if any(side > there * (1 + 1e-9) for side, there in zip(face, extent, strict=True)):
            sizes = [" x ".join(f"{1e3 * side:.4g}" for side in two) for two in (extent, face)]
            return [
                f"{key}: covers {sizes[0]} mm, and a face has {sizes[1]} mm; measure more, or set "
                "roughness.repeat = true (continued by mirror images)"
            ]
    return []


def _table_problems(name: str, path: Path, frequencies: Float[np.ndarray, " freqs"]) -> list[str]:
    try:
        table = read_permittivity_table(path)
    except ScenarioError as error:
        return [f"objects.{name}.material.file: {error}"]
    lowest, highest = float(table.frequencies[0]), float(table.frequencies[-1])
    problem = band_problem(frequencies, lowest, highest)
    return [f"objects.{name}.material.file: {path} {problem}"] if problem else []


def _misplaced(
    name: str, body: Plate | Cylinder | Box | MeshFile, frozen: MeshFile, *, flat: bool
) -> list[str]:
    """Find a realisation whose extents differ from the object's by more than its heights."""
    axes = 2 if flat else 3
    given = placed_mesh(frozen).bounds
    if isinstance(body, MeshFile):
        expected = placed_mesh(body).bounds
    elif isinstance(body, Cylinder):
        reach = np.array([body.radius_m, body.radius_m, (body.height_m or 0.0) / 2])
        expected = np.stack([body.centre - reach, body.centre + reach])
    else:
        vertices = upright_shape(body, np.inf, Heights(None, np.random.default_rng(0))).vertices
        expected = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
    apart = float(np.abs(given - expected)[:, :axes].max())
    limit = ROUNDED + HIGHEST * (0.0 if body.roughness is None else body.roughness.rms)
    if isinstance(body, Cylinder):
        # The file has chords for circles; a chord of length e lies up to e² / 8r inside its circle.
        limit += LONGEST_CHORD**2 / 8 * body.radius_m
    if apart <= limit:
        return []
    return [
        f"objects.{name}.realisation: the extents of {frozen.file!r} are {apart * 1e3:.3g} mm off "
        f"those of the object, and heights of its roughness explain {limit * 1e3:.3g} mm; move "
        "one to the other, or raise roughness.rms_mm"
    ]
