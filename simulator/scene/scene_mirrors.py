"""The mirrors of a 3-D scene, the objects they belong to, and the legs over them within beams."""

from collections.abc import Container, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from scenes.scenario import Scenario
from scenes.schema.errors import ScenarioError
from scenes.schema.objects import Box, Cylinder, MeshFile, Plate
from simulator.antennas.beam_culling import AntennaGroup
from simulator.geometry.mean_surfaces import mean_mirrors, mean_surfaces
from simulator.geometry.mirrors import Mirrors
from simulator.materials.fresnel_slab import Material
from simulator.specular.image_sources import DIRECT, Leg, legs_within_reach
from simulator.specular.ray_launching import launched_sequences

LARGEST_TARGET = 0.5
"""Longest side of a body of flat faces that is cut into facets where it is seen over mirrors;
larger ones are mirrors themselves, and curved ones are cut whatever their size. [m]"""

MOST_LAUNCHED = 200_000
"""Most legs that launched rays may find: tracing one takes some 0.3 ms for each user. [-]"""


@dataclass(frozen=True, kw_only=True)
class SceneMirrors:
    """The mirrors of a scene, and the legs over them."""

    mirrors: Mirrors
    owners: tuple[str, ...]  # the object that each mirror is a face of
    legs: tuple[Leg, ...]  # to targets: one bounce is left for the target
    chains: tuple[Leg, ...]  # up to the largest number of bounces
    targets: tuple[str, ...]  # objects whose facets are illuminated over legs
    mirrored: frozenset[str] = frozenset()  # objects without facets, which reflect by images

    def of(self, name: str) -> frozenset[int]:
        """Mirrors that are faces of an object."""
        return frozenset(index for index, owner in enumerate(self.owners) if owner == name)

    def by_images(self, leg: Leg) -> bool:
        """Return whether the reflection over a leg is a specular path, not a sum over facets."""
        return leg.bounces > 1 or self.owners[leg.sequence[0]] in self.mirrored


def scene_mirrors(
    scenario: Scenario,
    materials: Mapping[str, Material],
    groups: tuple[AntennaGroup, ...],
    *,
    mirrored: frozenset[str] = frozenset(),
    passing: Container[str] = (),
) -> SceneMirrors:
    """Find a scenario's mirrors, and the legs over them.

    Parameters
    ----------
    scenario, materials
        The scene, and the material of each object.
    groups
        The array's antennas.
    mirrored
        Bodies without facets.
    passing
        Bodies that transmit waves.

    Raises
    ------
    ScenarioError
        If the antennas reach too many ways over mirrors.
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
    owners = tuple(name for name, part in parts.items() for _ in range(len(part)))
    chains: tuple[Leg, ...] = ()
    most = scenario.max_bounces
    if most > 1 or mirrored:
        through = np.array([owner in passing for owner in owners], dtype=bool)
        chains = _chains(mirrors, groups, most, through)
    return SceneMirrors(
        mirrors=mirrors,
        owners=owners,
        legs=tuple(leg for leg in chains if leg.bounces < most),
        chains=chains,
        targets=tuple(
            name
            for name, body in scenario.objects.items()
            if not isinstance(body, Plate)
            and name not in mirrored
            and (not len(parts[name]) or longest_side(scenario, name) <= LARGEST_TARGET)
        ),
        mirrored=mirrored,
    )


def _chains(
    mirrors: Mirrors,
    groups: tuple[AntennaGroup, ...],
    most: int,
    passing: Bool[np.ndarray, " mirrors"],
) -> tuple[Leg, ...]:
    """Find the legs within antennas' patterns: all, or those that rays meet if they are many."""
    tried = legs_within_reach(mirrors, groups, most)
    if tried is not None:
        return tried
    sequences = launched_sequences(mirrors, groups, most, passing=passing)
    if len(sequences) > MOST_LAUNCHED:
        raise ScenarioError(
            f"max_bounces = {most}: the antennas reach more than {MOST_LAUNCHED} ways over up to "
            f"{most} mirrors; set max_bounces = {most - 1}, or give the base station a narrower "
            "antenna"
        )
    return tuple(DIRECT.onward(mirrors, *sequence) for sequence in sequences)


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
