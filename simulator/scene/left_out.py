"""Classes of paths that a simulation leaves out, with an estimate of their level.

Levels are those of single specular paths between each user and the centre of the array, at the
middle of the band, relative to that user's strongest simulated path; for diffraction round edges,
of Fresnel's knife edge (ITU-R P.526, eq. 26 to 31). They estimate strength only, not delay or
direction.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light
from scipy.special import fresnel

from scenes.realisations.object_surface import Surface
from scenes.scenario import Scenario
from scenes.schema.effects import Effects
from simulator.antennas.beam_culling import AntennaGroup
from simulator.geometry.mean_surfaces import mean_mirrors, mean_surfaces
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.ray_scene import RayScene, blocked, build_scene
from simulator.geometry.slabs import Slabs
from simulator.scene.array_antennas import array_group, user_group
from simulator.scene.radio_scene import opaque, scenario_materials
from simulator.scene.scene_slabs import scene_slabs
from simulator.specular.free_space import direct_wave
from simulator.specular.image_method import find_chains
from simulator.specular.path_field import chain_response
from simulator.specular.ray_launching import likely_sequences

MOST_CHAINS = 50_000
"""Most sequences of mirrors searched for a path of one more bounce: some seconds. [-]"""

LONGEST_COMPARED = 2
"""Bounces up to which the strongest simulated path is searched: longer paths are weaker. [-]"""

FAINT_DB = -60.0
"""Level relative to the strongest path below which nothing is reported. [dB]"""

EDGE_STEP = 0.02
"""Spacing of the points on bodies' edges at which diffraction is evaluated. [m]"""

MOST_POINTS = 1_000_000
"""Most points on all edges together; in large scenes their spacing is larger. [-]"""


class LeftOut(NamedTuple):
    """A class of paths that a simulation leaves out."""

    what: str
    level_db: float  # of its strongest path relative to the strongest simulated one [dB]

    def __str__(self) -> str:
        """Return the class and its level as text."""
        return f"{self.what}: {self.level_db:.0f} dB of the strongest path"


def effects_told(scenario: Scenario) -> str:
    """Return as text which effects are on and which are off."""
    told = [f"up to {scenario.max_bounces} bounces"]
    for name in Effects.model_fields:
        told.append(f"{name} {'on' if getattr(scenario.effects, name) else 'off'}")
    return ", ".join(told)


def left_out(scenario: Scenario) -> tuple[LeftOut, ...]:
    """Estimate what a simulation of a scenario leaves out, the strongest first.

    Parameters
    ----------
    scenario
        The truth.

    Returns
    -------
    One entry for each class, of the user for which its level is highest; none below
    :data:`FAINT_DB`.
    """
    if scenario.base_station.multistatic:
        return ()
    strongest: dict[str, float] = {}
    room = _Room.of(scenario)
    for name in scenario.users:
        simulated = room.pilot(name, 0, min(scenario.max_bounces, LONGEST_COMPARED))
        for what, level in _of_user(scenario, room, name):
            relative = 20 * np.log10(level / max(simulated, 1e-15)) if level > 0 else -np.inf
            strongest[what] = max(strongest.get(what, -np.inf), float(min(relative, 300.0)))
    found = [LeftOut(what, level) for what, level in strongest.items() if level >= FAINT_DB]
    return tuple(sorted(found, key=lambda one: -one.level_db))


def model_told(scenario: Scenario) -> dict[str, str | list[str]]:
    """Return by what model a scenario is simulated, and what that leaves out.

    Returns
    -------
    ``model``: bounces and effects; ``left_out``: classes of paths with their level.
    """
    return {
        "model": effects_told(scenario),
        "left_out": [str(one) for one in left_out(scenario)],
    }


def model_lines(told: Mapping[str, object]) -> Iterator[str]:
    """Yield the document of :func:`model_told` as lines of text, one for the model."""
    left = told.get("left_out")
    most = str(left[0]) if isinstance(left, list) and left else "nothing known above -60 dB"
    yield f"{told.get('model')}; left out of pilots, at most: {most}"


def _of_user(scenario: Scenario, room: "_Room", name: str) -> Iterator[tuple[str, float]]:
    most = scenario.max_bounces
    if not scenario.effects.line_of_sight:
        yield "the line of sight", room.pilot(name, 0, 0, line_of_sight=True)
    if not scenario.effects.transmission:
        on = scenario.effects.model_copy(update={"transmission": True})
        through = _Room.of(scenario.model_copy(update={"effects": on}))
        yield "transmission through slabs", through.pilot(name, 0, min(most, LONGEST_COMPARED))
    if len(room.mirrors) ** (most + 1) <= MOST_CHAINS:
        yield f"paths of {most + 1} bounces", room.pilot(name, most + 1, most + 1)
    if not scenario.effects.diffraction:
        yield "diffraction round edges", room.round_an_edge(name)


class _Room(NamedTuple):
    scenario: Scenario
    mirrors: Mirrors
    rays: RayScene
    slabs: Slabs
    edges: Float[np.ndarray, "places 3"]

    @classmethod
    def of(cls, scenario: Scenario) -> "_Room":
        surfaces, materials = mean_surfaces(scenario), scenario_materials(scenario)
        slabs = scene_slabs(scenario, materials)
        places = [np.empty((0, 3))]
        step = max(EDGE_STEP, _edge_length(opaque(surfaces, slabs)) / MOST_POINTS)
        for surface in opaque(surfaces, slabs):
            corners = surface.vertices[surface.cells]
            if surface.cells.shape[1] == 2:
                places.append(corners.reshape(-1, 3))
                continue
            for first, second in ((0, 1), (1, 2), (2, 0)):
                along = corners[:, second] - corners[:, first]
                count = 1 + int(np.linalg.norm(along, axis=-1).max() / step)
                share = (np.arange(count) + 0.5)[:, None, None] / count
                places.append((corners[:, first] + share * along).reshape(-1, 3))
        return cls(
            scenario,
            mean_mirrors(scenario, surfaces, materials),
            build_scene(opaque(surfaces, slabs)),
            slabs,
            np.concatenate(places),
        )

    def pilot(
        self, name: str, fewest: int, most: int, *, line_of_sight: bool | None = None
    ) -> float:
        """Return the amplitude of the strongest path with a number of reflections. [-]."""
        sender, array = self._ends(name)
        if line_of_sight is None:
            line_of_sight = self.scenario.effects.line_of_sight
        among = None
        if self.scenario.dimensions == 3:
            among = likely_sequences(self.mirrors, sender, most)
        chains = find_chains(
            self.mirrors,
            sender.positions,
            array.centre[None],
            blocked=partial(blocked, self.rays),
            clearance=self.rays.clearance,
            max_bounces=most,
            min_bounces=max(fewest, 0 if line_of_sight else 1),
            slabs=self.slabs,
            among=among,
        )
        middle = np.array([self.scenario.radio.centre_frequency])
        levels = [
            chain_response(self.mirrors, chain, middle, sender, array, self.slabs)
            for chain in chains
        ]
        return max((float(np.abs(level[0])) for level in levels), default=0.0)

    def round_an_edge(self, name: str) -> float:
        """Return the amplitude diffracted at the nearest edge, if the line of sight is blocked.

        Fresnel's knife edge, with the parameter v = 2 √(Δ/λ) of the detour Δ. [-]
        """
        sender, array = self._ends(name)
        user, centre = sender.positions[0], array.centre
        if not len(self.edges) or not blocked(self.rays, user[None], centre[None])[0]:
            return 0.0
        straight = float(np.linalg.norm(user - centre))
        lengths = [np.linalg.norm(self.edges - end, axis=-1) for end in (user, centre)]
        detours = lengths[0] + lengths[1] - straight
        for nearest in np.argsort(detours)[:64]:
            place = self.edges[nearest]
            # Just beyond the edge, away from the nearest point of the straight line.
            share = lengths[0][nearest] / (lengths[0][nearest] + lengths[1][nearest])
            outward = place - (user + share * (centre - user))
            beyond = place + 1e-4 * outward / max(float(np.linalg.norm(outward)), 1e-9)
            ends = np.stack([user, centre])
            if blocked(self.rays, np.stack([beyond, beyond]), ends).any():
                continue
            wavelength = speed_of_light / self.scenario.radio.centre_frequency
            v = 2 * np.sqrt(float(detours[nearest]) / wavelength)
            sine, cosine = fresnel(v)
            shadow = abs((1 + 1j) / 2 * ((0.5 - cosine) - 1j * (0.5 - sine)))
            ways = [place - user, place - centre]
            gains = [
                float(end.pattern.towards((way / np.linalg.norm(way))[None])[0])
                for end, way in zip((sender, array), ways, strict=True)
            ]
            middle = np.array([self.scenario.radio.centre_frequency])
            wave = direct_wave(np.array([straight]), middle, waves="spherical")
            return float(gains[0] * gains[1] * shadow * abs(wave[0, 0]))
        return 0.0

    def _ends(self, name: str) -> tuple[AntennaGroup, AntennaGroup]:
        elements = self.scenario.base_station.element_positions
        return user_group(self.scenario, name), array_group(self.scenario, elements)


def _edge_length(surfaces: Sequence[Surface]) -> float:
    """Sum the edges of triangles, each taken for as long as the longest of its surface. [m]."""
    total = 0.0
    for surface in surfaces:
        if surface.cells.shape[1] == 3:
            corners = surface.vertices[surface.cells]
            along = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)
            total += float(along.max(axis=0).sum()) * len(along)
    return total
