"""The specular paths of a scenario: from the array to each user, and to each hidden target."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from scenes.realisations.object_surface import Surface
from scenes.scenario import Scenario
from scenes.schema.antenna import Antenna
from scenes.schema.objects import Plate
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.polarization import VERTICAL
from simulator.geometry.mean_surfaces import mean_mirrors, mean_surfaces
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.ray_scene import RayScene, blocked, build_scene
from simulator.geometry.slabs import Slabs
from simulator.materials.fresnel_slab import Absorber
from simulator.materials.slab_insertion import LEAST_LEVEL, along_field, through_slabs
from simulator.scene.array_antennas import array_group
from simulator.scene.radio_scene import opaque, scenario_materials
from simulator.scene.scene_mirrors import LARGEST_TARGET, longest_side
from simulator.scene.scene_slabs import scene_slabs
from simulator.specular.image_method import Chain, find_chains
from simulator.specular.ray_launching import likely_sequences

PLACES = 17
"""Places on each line of a target from which paths to the array are sought."""

FAINTEST_DB = 20 * math.log10(LEAST_LEVEL)
"""Transmission below which a path is not listed: it is not simulated either. [dB]"""

MOST_PER_TARGET = 3
"""Chains of mirrors shown for one target, the shortest ones."""


@dataclass(frozen=True, kw_only=True)
class ScenarioPath:
    """One specular path from the centre of the array."""

    end: str  # name of the user or object at its end
    kind: Literal["user", "object", "receiver"]
    vertices: Float[np.ndarray, "vertices 3"]  # from the array onward [m]
    gain_db: float  # of both antennas in its direction, relative to their peaks [dB]
    through: tuple[str, ...] = ()  # objects that it crosses, once for each slab met
    transmission_db: float = 0.0  # of these, in the middle of the band [dB]

    @property
    def bounces(self) -> int:
        """Number of reflections."""
        return len(self.vertices) - 2

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(np.linalg.norm(np.diff(self.vertices, axis=0), axis=-1).sum())


def scenario_paths(scenario: Scenario) -> tuple[ScenarioPath, ...]:
    """Find the specular paths over the smooth mean surfaces, each segment tested for occlusion.

    Parameters
    ----------
    scenario
        Its plates, boxes and meshes of few faces are mirrors, unless they absorb.

    Returns
    -------
    First the users' paths, then those to the nearest place of each object other than plates; by
    number of bounces. In scenes of too many mirrors to try all sequences, only of objects small
    enough to be targets. For separate antennas, the path from the first transmitter over each
    mirror to the receiver with the strongest signal.

    Raises
    ------
    ScenarioError
        If a material is not known over the band.
    """
    surfaces = mean_surfaces(scenario)
    materials = scenario_materials(scenario)
    mirrors = mean_mirrors(scenario, surfaces, materials)
    if scenario.base_station.multistatic:
        return tuple(_to_receivers(scenario, mirrors, build_scene(surfaces)))
    slabs = scene_slabs(scenario, materials)
    among = None
    if scenario.dimensions == 3:
        array = array_group(scenario, scenario.base_station.element_positions)
        among = likely_sequences(mirrors, array, scenario.max_bounces)
    room = _Room(mirrors, build_scene(opaque(surfaces, slabs)), slabs, among)
    found = [*_to_users(scenario, room)]
    for surface in surfaces:
        body = scenario.objects[surface.name]
        if among is not None and longest_side(scenario, surface.name) > LARGEST_TARGET:
            continue
        if not isinstance(body, Plate) and not isinstance(materials[surface.name], Absorber):
            found += _to_object(scenario, surface, room)
    return tuple(found)


class _Room(NamedTuple):
    """The mirrors, the opaque surfaces and the transmitting slabs of a scenario."""

    mirrors: Mirrors
    rays: RayScene
    slabs: Slabs
    among: tuple[tuple[int, ...], ...] | None  # sequences of mirrors to look among; None: all

    def through(self, chain: Chain, path: int) -> tuple[int, ...]:
        """Return the set of slabs on each leg of a chain's path."""
        return () if chain.crossed is None else tuple(chain.crossed[path].tolist())

    def owners(self, sets: Sequence[int]) -> tuple[str, ...]:
        """Name the objects of sets of slabs."""
        faces = [face for one in sets for face in range(len(self.slabs)) if one >> face & 1]
        return tuple(self.slabs.owners[face] for face in faces)


def _to_users(scenario: Scenario, room: _Room) -> Iterator[ScenarioPath]:
    centre, (mirrors, rays, slabs, among) = _centre(scenario), room
    for name, user in scenario.users.items():
        chains = find_chains(
            mirrors,
            centre[None],
            user.position[None],
            blocked=partial(blocked, rays),
            clearance=rays.clearance,
            max_bounces=scenario.max_bounces,
            slabs=slabs,
            among=among,
        )
        for chain in chains:
            if not chain.mirrors and not scenario.effects.line_of_sight:
                continue
            sets = room.through(chain, 0)
            loss = _transmission_db(scenario, room, chain, sets)
            if loss < FAINTEST_DB:
                continue
            gain = _gain_db(scenario, scenario.base_station.antenna, centre, chain.departures[0])
            gain += _gain_db(scenario, user.antenna, user.position, chain.arrivals[0])
            yield ScenarioPath(
                end=name,
                kind="user",
                vertices=np.stack([centre, *chain.vertices[0], user.position]),
                gain_db=gain,
                through=room.owners(sets),
                transmission_db=loss,
            )


def _transmission_db(scenario: Scenario, room: _Room, chain: Chain, sets: tuple[int, ...]) -> float:
    """Transmission of a vertical field through the slabs on a chain's first path [dB]."""
    middle, loss = np.array([scenario.radio.centre_frequency]), 0.0
    vertical = scenario.dimensions == 3 or scenario.radio.polarization == "vertical"
    for leg, one in enumerate(sets):
        crossings = room.slabs.crossings(one)
        if not crossings:
            continue
        way, length = chain.directions[:1, leg], chain.lengths[:1]
        if scenario.dimensions == 3:
            field = VERTICAL.field(way)
            left = along_field(crossings, way, length, middle, field)
        else:
            left = through_slabs(
                crossings, way, length, middle, vertical=vertical, cylindrical=True
            )
        loss += float(20 * np.log10(max(abs(left[0, 0]), 1e-15)))
    return loss


def _to_receivers(scenario: Scenario, mirrors: Mirrors, rays: RayScene) -> Iterator[ScenarioPath]:
    station = scenario.base_station
    places = station.element_positions
    senders = station.transmit_positions(places)
    sender = places[0] if senders is None else senders[0]
    chains = find_chains(
        mirrors,
        sender[None],
        places,
        blocked=partial(blocked, rays),
        clearance=rays.clearance,
        max_bounces=1,
    )
    for chain in chains:
        valid = np.flatnonzero(chain.valid[0])
        if len(chain.vertices[0]) == 0:
            continue  # direct coupling between the horns: not part of the echo
        gains = [
            _gain_db(scenario, station.transmit_antenna, sender, departure)
            + _gain_db(scenario, station.antenna, places[index], arrival)
            for index, departure, arrival in zip(
                valid, chain.departures, chain.arrivals, strict=True
            )
        ]
        best = int(np.argmax(gains))
        yield ScenarioPath(
            end=f"receiver {valid[best]}",
            kind="receiver",
            vertices=np.stack([sender, *chain.vertices[best], places[valid[best]]]),
            gain_db=gains[best],
        )


def _to_object(scenario: Scenario, surface: Surface, room: _Room) -> list[ScenarioPath]:
    centre, (mirrors, rays, slabs, among) = _centre(scenario), room
    places, outward = _places(surface)
    if scenario.max_bounces == 0:
        return []
    chains = find_chains(
        mirrors,
        centre[None],
        places,
        blocked=partial(blocked, rays),
        clearance=rays.clearance,
        max_bounces=scenario.max_bounces - 1,
        receiver_offsets=rays.clearance * outward,
        slabs=slabs,
        among=among,
    )
    # The body's surface is one bounce; the return leg has at least the fewest mirrors.
    lit = [chain for chain in chains if _lit(chain, outward).any()]
    fewest = min((len(chain.mirrors) for chain in lit), default=0)
    lit = [one for one in lit if fewest + 1 + len(one.mirrors) <= scenario.max_bounces]
    shortest = []
    for chain in lit:
        seen = _lit(chain, outward)
        if seen.any():
            best = int(np.flatnonzero(seen)[np.argmin(chain.lengths[seen])])
            place = places[np.flatnonzero(chain.valid[0])[best]]
            vertices = np.stack([centre, *chain.vertices[best], place])
            gain = _gain_db(scenario, scenario.base_station.antenna, centre, chain.departures[best])
            shortest.append(
                ScenarioPath(
                    end=surface.name,
                    kind="object",
                    vertices=vertices,
                    gain_db=gain,
                    through=room.owners(room.through(chain, best)),
                )
            )
    shortest.sort(key=lambda path: path.length)
    return sorted(shortest[:MOST_PER_TARGET], key=lambda path: (path.bounces, path.length))


def _lit(chain: Chain, outward: Float[np.ndarray, "places 3"]) -> Bool[np.ndarray, " paths"]:
    """Return which paths arrive at the outer side of the surface."""
    normals = outward[np.flatnonzero(chain.valid[0])]
    lit: np.ndarray = np.einsum("px,px->p", chain.arrivals, normals) > 0
    return lit


def _places(
    surface: Surface,
) -> tuple[Float[np.ndarray, "places 3"], Float[np.ndarray, "places 3"]]:
    """Return places spread over a surface's cells, with the cells' outward normals."""
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
    return scenario.base_station.centre


def _gain_db(
    scenario: Scenario,
    antenna: Antenna,
    place: Float[np.ndarray, " 3"],
    direction: Float[np.ndarray, " 3"],
) -> float:
    aim = scenario.aim(antenna, place)
    here, peak = field_gain(antenna, aim, np.stack([direction, aim]))
    return float(20 * np.log10(max(here / peak, 1e-15)))
