"""The mirrors of a 3-D scene, the objects they belong to, and the legs over them within beams."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenes.scenario import Scenario
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate
from simulator.antennas.beam_culling import AntennaGroup
from simulator.geometry.mean_surfaces import mean_mirrors, mean_surfaces
from simulator.geometry.mirrors import Mirrors
from simulator.materials.fresnel_slab import Material
from simulator.specular.image_sources import Leg, legs_within_reach

LARGEST_TARGET = 0.5
"""Longest side of a body that is divided into facets for echoes over mirrors; faces of larger
bodies are mirrors. [m]"""


@dataclass(frozen=True, kw_only=True)
class SceneMirrors:
    """The mirrors of a scene, and the legs over them."""

    mirrors: Mirrors
    owners: tuple[str, ...]  # the object that each mirror is a face of
    legs: tuple[Leg, ...]  # to targets: one bounce is left for the target
    chains: tuple[Leg, ...]  # up to the largest number of bounces
    targets: tuple[str, ...]  # objects whose facets are illuminated over legs

    def of(self, name: str) -> frozenset[int]:
        """Mirrors that are faces of an object."""
        return frozenset(index for index, owner in enumerate(self.owners) if owner == name)


def scene_mirrors(
    scenario: Scenario, materials: Mapping[str, Material], groups: tuple[AntennaGroup, ...]
) -> SceneMirrors:
    """Find a scenario's mirrors, and the legs over them.

    Parameters
    ----------
    scenario, materials
        The scene, and the material of each object.
    groups
        The array's antennas.
    """
    parts = {
        surface.name: mean_mirrors(scenario, [surface], dict(materials))
        for surface in mean_surfaces(scenario)
    }
    mirrors = Mirrors(
        corners=np.concatenate([np.empty((0, 4, 3)), *(part.corners for part in parts.values())]),
        materials=tuple(material for part in parts.values() for material in part.materials),
        rms_heights=np.concatenate([np.empty(0), *(part.rms_heights for part in parts.values())]),
        two_sided=np.concatenate(
            [np.empty(0, dtype=bool), *(part.two_sided for part in parts.values())]
        ),
    )
    chains: tuple[Leg, ...] = ()
    if scenario.max_bounces > 1:
        chains = legs_within_reach(mirrors, groups, scenario.max_bounces)
    return SceneMirrors(
        mirrors=mirrors,
        owners=tuple(name for name, part in parts.items() for _ in range(len(part))),
        legs=tuple(leg for leg in chains if leg.bounces < scenario.max_bounces),
        chains=chains,
        targets=tuple(n for n in scenario.objects if longest_side(scenario, n) <= LARGEST_TARGET),
    )


def longest_side(scenario: Scenario, name: str) -> float:
    """Return the longest side of a body [m]; a plate is not a body."""
    body = scenario.objects[name]
    match body:
        case Plate():
            return float("inf")
        case Cylinder():
            return max(2 * body.radius_m, body.height_m or float("inf"))
        case Box():
            return max(body.length_m, body.depth_m, body.height_m or float("inf"))
        case MeshFile():
            from scenes.meshes.mesh_file import placed_mesh

            bounds = np.asarray(placed_mesh(body).bounds)
            return float((bounds[1] - bounds[0]).max())
