"""Which of a scenario's bodies let waves through."""

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
    """Tell whether a material has a far face that waves may come out of."""
    return isinstance(material, Dielectric) and bool(np.isfinite(material.thickness))


def scene_slabs(scenario: Scenario, materials: Mapping[str, Material]) -> Slabs:
    """Find the faces that let waves through; plates first, then bodies, as shells of slabs.

    Cylinders and meshes of many faces block: their faces are no planes. So does what lets less
    through than -60 dB, and what there are no bits left for
    (:data:`simulator.geometry.slabs.MOST_SLABS`).

    Parameters
    ----------
    scenario, materials
        What there is, and what it is made of.
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
