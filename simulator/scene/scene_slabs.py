"""The bodies of a scenario that transmit waves, as slabs."""

from collections.abc import Mapping

import numpy as np

from scenes.realisations.object_surface import Surface
from scenes.scenario import Scenario
from scenes.schema.objects import Cylinder, MeshFile, Plate
from simulator.geometry.mean_surfaces import MOST_FACES, mean_mirrors, mean_surfaces
from simulator.geometry.slabs import MOST_SLABS, Slabs, no_slabs
from simulator.materials.fresnel_slab import Dielectric, Material
from simulator.materials.slab_insertion import LEAST_LEVEL, Crossing, passage_level


def is_slab(material: Material) -> bool:
    """Return whether waves may leave a material through its far face."""
    return isinstance(material, Dielectric) and bool(np.isfinite(material.thickness))


def scene_slabs(scenario: Scenario, materials: Mapping[str, Material]) -> Slabs:
    """Return the faces that transmit waves: plates first, then bodies, as shells of slabs.

    Opaque are cylinders and meshes of many faces, which are not planes; slabs that transmit less
    than -60 dB; and slabs beyond the number that the bit sets of crossed slabs can hold
    (:data:`simulator.geometry.slabs.MOST_SLABS`).

    Parameters
    ----------
    scenario, materials
        The scene, and the material of each object.
    """
    if not scenario.effects.transmission:
        return no_slabs()
    frequencies = scenario.radio.frequencies
    surfaces = [
        surface
        for surface in mean_surfaces(scenario)
        if is_slab(materials[surface.name])
        and not isinstance(scenario.objects[surface.name], Cylinder)
        and not (
            isinstance(scenario.objects[surface.name], MeshFile) and len(surface.cells) > MOST_FACES
        )
        and passage_level([_upright(materials[surface.name])], frequencies) >= LEAST_LEVEL
    ]
    surfaces.sort(key=lambda surface: not isinstance(scenario.objects[surface.name], Plate))
    kept: list[Surface] = []
    owners: list[str] = []
    for surface in surfaces:
        own = mean_mirrors(scenario, [surface], dict(materials))
        if len(owners) + len(own) <= MOST_SLABS:
            kept.append(surface)
            owners += [surface.name] * len(own)
    if not kept:
        return no_slabs()
    return Slabs(faces=mean_mirrors(scenario, kept, dict(materials)), owners=tuple(owners))


def _upright(material: Material) -> Crossing:
    if not isinstance(material, Dielectric):
        raise TypeError(f"{material} lets nothing through")
    return Crossing(material, np.array([0.0, 1.0, 0.0]))
