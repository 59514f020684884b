"""The specular paths of a scenario: from the array to each user, and to each hidden target."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from scenes.antenna import Antenna
from scenes.objects import Box, Cylinder, MeshFile, Plate
from scenes.scenario import Scenario
from scenes.shapes import Surface
from simulator.antennas import field_gain
from simulator.materials import Absorber, Conductor, Material
from simulator.mirrors import Mirrors, line_mirrors
from simulator.radio_scene import scenario_materials
from simulator.ray_scene import blocked, build_scene
from simulator.sionna_scene import mean_surfaces
from simulator.specular_paths import Blocked, Chain, find_chains

PLACES = 17
"""Places on each line of a target from which paths to the array are sought."""

MOST_PER_TARGET = 3
"""Chains of mirrors shown for one target, the shortest ones."""

MOST_FACES = 64
"""A mesh of more faces counts as curved, and is no mirror: chains grow as a power of them."""

_ON_SURFACE = 2e-6  # how far off its surface a target's place is tested for occlusion [m]
_SAME_PLANE = 1e-9  # how far apart the two triangles of a rectangle lie at most [m]


@dataclass(frozen=True, kw_only=True)
class ScenarioPath:
    """One specular path from the centre of the array."""

    end: str  # name of the user or object at its end
    kind: Literal["user", "object"]
    vertices: Float[np.ndarray, "vertices 3"]  # from the array onward [m]
    gain_db: float  # of both antennas in its direction, relative to their peaks [dB]

    @property
    def bounces(self) -> int:
        """Number of mirrors on the way."""
        return len(self.vertices) - 2

    @property
    def length(self) -> float:
        """Length of the way [m]."""
        return float(np.linalg.norm(np.diff(self.vertices, axis=0), axis=-1).sum())


def scenario_paths(scenario: Scenario) -> tuple[ScenarioPath, ...]:
    """Find the specular paths over the smooth mean surfaces, each segment tested for occlusion.

    Parameters
    ----------
    scenario
        Its plates, boxes and meshes of few faces are mirrors, unless they absorb.

    Returns
    -------
    First the users' paths, then those to the nearest place of each object that is no plate;
    by number of bounces.

    Raises
    ------
    ScenarioError
        If a material is not known over the band.
    """
    surfaces = mean_surfaces(scenario)
    materials = scenario_materials(scenario)
    scene = build_scene(surfaces)
    mirrors = mean_mirrors(scenario, surfaces, materials)

    def meets(
        starts: Float[np.ndarray, "rays 3"], ends: Float[np.ndarray, "rays 3"]
    ) -> Bool[np.ndarray, " rays"]:
        return blocked(scene, starts, ends)

    found = [*_to_users(scenario, mirrors, meets)]
    for surface in surfaces:
        body = scenario.objects[surface.name]
        if not isinstance(body, Plate) and not isinstance(materials[surface.name], Absorber):
            found += _to_object(scenario, surface, mirrors, meets)
    del scene
    return tuple(found)


def mean_mirrors(
    scenario: Scenario, surfaces: list[Surface], materials: dict[str, Material]
) -> Mirrors:
    """Make mirrors of the flat mean surfaces of a scenario.

    Parameters
    ----------
    scenario
        Its cylinders and curved meshes are no mirrors: a curved surface has no image.
    surfaces
        Its objects, smooth and as coarse as can be.
    materials
        What they are made of; absorbers are no mirrors either.
    """
    corners, made, rough, two_sided = [np.empty((0, 4, 3))], [], [], []
    for surface in surfaces:
        body, material = scenario.objects[surface.name], materials[surface.name]
        curved = isinstance(body, MeshFile) and len(surface.cells) > MOST_FACES
        if curved or isinstance(body, Cylinder) or isinstance(material, Absorber):
            continue
        flat = _flat_mirrors(surface)
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
    """Join the two triangles of each rectangle: a path over its middle has one mirror then."""
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
            if abs(height) < _SAME_PLANE and across[first] @ across[k] > 1 - 1e-12
        ]
        second = same[0]
        left.remove(second)
        # The corner of the second triangle that is not on the first one.
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


def _to_users(scenario: Scenario, mirrors: Mirrors, meets: Blocked) -> Iterator[ScenarioPath]:
    centre = _centre(scenario)
    for name, user in scenario.users.items():
        chains = find_chains(
            mirrors,
            centre[None],
            user.position[None],
            blocked=meets,
            max_bounces=scenario.max_bounces,
        )
        for chain in chains:
            gain = _gain_db(scenario, scenario.base_station.antenna, centre, chain.departures[0])
            gain += _gain_db(scenario, user.antenna, user.position, chain.arrivals[0])
            yield ScenarioPath(
                end=name,
                kind="user",
                vertices=np.stack([centre, *chain.vertices[0], user.position]),
                gain_db=gain,
            )


def _to_object(
    scenario: Scenario, surface: Surface, mirrors: Mirrors, meets: Blocked
) -> list[ScenarioPath]:
    centre = _centre(scenario)
    places, outward = _places(surface)
    chains = find_chains(
        mirrors,
        centre[None],
        places,
        blocked=meets,
        max_bounces=scenario.max_bounces,
        receiver_offsets=_ON_SURFACE * outward,
    )
    shortest = []
    for chain in chains:
        seen = _lit(chain, outward)
        if seen.any():
            best = int(np.flatnonzero(seen)[np.argmin(chain.lengths[seen])])
            place = places[np.flatnonzero(chain.valid[0])[best]]
            vertices = np.stack([centre, *chain.vertices[best], place])
            gain = _gain_db(scenario, scenario.base_station.antenna, centre, chain.departures[best])
            shortest.append(
                ScenarioPath(end=surface.name, kind="object", vertices=vertices, gain_db=gain)
            )
    shortest.sort(key=lambda path: path.length)
    return sorted(shortest[:MOST_PER_TARGET], key=lambda path: (path.bounces, path.length))


def _lit(chain: Chain, outward: Float[np.ndarray, "places 3"]) -> Bool[np.ndarray, " paths"]:
    """Tell which paths arrive at the outer side of the surface."""
    normals = outward[np.flatnonzero(chain.valid[0])]
    lit: np.ndarray = np.einsum("px,px->p", chain.arrivals, normals) > 0
    return lit


def _places(
    surface: Surface,
) -> tuple[Float[np.ndarray, "places 3"], Float[np.ndarray, "places 3"]]:
    """Spread places over a surface's cells, with the cells' outward normals."""
    points = surface.vertices[surface.cells]
    share = (np.arange(PLACES) + 0.5) / PLACES
    if surface.cells.shape[1] == 2:
        along = points[:, 1] - points[:, 0]
        outward = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=-1)
        places = points[:, :1] + share[:, None] * along[:, None]
    else:
        outward = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        places = points.mean(axis=1, keepdims=True)
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    per_cell = places.shape[1]
    return places.reshape(-1, 3), np.repeat(outward, per_cell, axis=0)


def _centre(scenario: Scenario) -> Float[np.ndarray, " 3"]:
    return np.asarray(scenario.base_station.position_m, dtype=np.float64)


def _gain_db(
    scenario: Scenario,
    antenna: Antenna,
    place: Float[np.ndarray, " 3"],
    direction: Float[np.ndarray, " 3"],
) -> float:
    aim = scenario.aim(antenna, place)
    here, peak = field_gain(antenna, aim, np.stack([direction, aim]))
    return float(20 * np.log10(max(here / peak, 1e-15)))
