"""A user's pilot diffracted round edges of opaque bodies, in two dimensions.

Single diffraction at edges visible from both ends. If both ends are on the same side of a face of
the edge, the facets of physical optics and their fringe currents already radiate this wave, and
nothing is added. Left out: diffraction at two and more edges and at curved bodies, in echoes and
in chains of mirrors, through slabs, and at the edges of slabs that transmit waves.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from scenes.scenario import User
from scenes.schema.objects import Cylinder, MeshFile
from simulator.antennas.field_pattern import field_gain
from simulator.geometry.ray_scene import blocked
from simulator.materials.fresnel_slab import Conductor
from simulator.scattering.shadow_edge import wedge_coefficient
from simulator.scene.radio_scene import RadioScene, scenario_materials
from simulator.specular.free_space import direct_wave

OUT = 2e-5
"""Distance from the edge at which rays to it end: ten times the least clearance of rays. [m]"""


class _Edge(NamedTuple):
    place: Float[np.ndarray, " 3"]  # [m]
    inward: Float[np.ndarray, "faces 3"]  # unit vectors along the one or two faces
    exterior: float  # exterior angle (filled with air), over π [-]
    conducts: bool


def pilot_round_edges(scene: RadioScene, user: User) -> Complex[np.ndarray, "elements freqs"]:
    """Sum a user's pilot over single diffraction at edges.

    Parameters
    ----------
    scene
        The frozen scene, of two dimensions.
    user
        The transmitting user.

    Returns
    -------
    S-parameter at each element (cylindrical waves: field). [-]
    """
    scenario, station = scene.scenario, scene.scenario.base_station
    elements, frequencies = scene.elements, scenario.radio.frequencies
    pilot = np.zeros((len(elements), frequencies.size), dtype=np.complex128)
    aims = (
        scenario.aim(user.antenna, user.position),
        scenario.aim(station.antenna, elements.mean(axis=0)),
    )
    wavenumber = 2 * np.pi * frequencies / speed_of_light
    vertical = scenario.radio.polarization == "vertical"
    for edge in scene_edges(scene):
        outward = -edge.inward.sum(axis=0)
        near = edge.place + OUT * outward / np.linalg.norm(outward)
        if blocked(scene.rays, near[None], user.position[None])[0]:
            continue
        hidden = blocked(scene.rays, np.broadcast_to(near, elements.shape), elements)
        there, here = user.position - edge.place, elements - edge.place
        incident, outgoing = _angle(edge, there[None]), _angle(edge, here)
        some = np.flatnonzero(~hidden & ~_facets_do(edge, scene, incident, outgoing))
        if some.size == 0:
            continue
        lengths = float(np.linalg.norm(there)), np.linalg.norm(here[some], axis=-1)
        gain = field_gain(user.antenna, aims[0], -there[None] / lengths[0])
        gain = gain * field_gain(station.antenna, aims[1], -here[some] / lengths[1][:, None])
        reflection = (-1.0 if vertical else 1.0) if edge.conducts else 0.0
        coefficient = wedge_coefficient(
            float(incident[0]),
            outgoing[some],
            lengths[0],
            lengths[1],
            wavenumber,
            exterior=edge.exterior,
            reflection=reflection,
        )
        wave = direct_wave(np.array([lengths[0]]), frequencies, waves="cylindrical")
        wave = wave * coefficient * np.exp(-1j * wavenumber * lengths[1][:, None])
        wave = wave * (gain / np.sqrt(lengths[1]))[:, None]
        if scenario.waves == "spherical":
            whole = (lengths[0] + lengths[1])[:, None]
            wave = wave * np.exp(0.25j * np.pi) * np.sqrt(speed_of_light / frequencies / whole)
        pilot[some] += wave
    return pilot


def scene_edges(scene: RadioScene) -> Iterator[_Edge]:
    """Yield the ends of opaque plates and the corners of opaque boxes."""
    scenario, materials = scene.scenario, scenario_materials(scene.scenario)
    for surface in scene.surfaces:
        body = scenario.objects[surface.name]
        if isinstance(body, Cylinder | MeshFile) or surface.name in scene.slabs.owners:
            continue
        conducts = isinstance(materials[surface.name], Conductor)
        ends = _outline(scene, surface.name)
        if not surface.closed:
            for one, other in (ends, ends[::-1]):
                along = (other - one) / np.linalg.norm(other - one)
                yield _Edge(one, along[None], 2.0, conducts)
            continue
        for before, here, after in zip(
            np.roll(ends, 1, axis=0), ends, np.roll(ends, -1, axis=0), strict=True
        ):
            inward = np.stack([after - here, before - here])
            inward /= np.linalg.norm(inward, axis=-1, keepdims=True)
            yield _Edge(here, inward, 1.5, conducts)


def _outline(scene: RadioScene, name: str) -> Float[np.ndarray, "corners 3"]:
    """Return a plate's ends, or a box's corners counter-clockwise. [m]."""
    body = scene.scenario.objects[name]
    if isinstance(body, Cylinder | MeshFile):
        raise TypeError(f"{name} has no straight edges")
    along = body.tangent * body.length_m / 2
    if body.kind == "plate":
        return np.stack([body.centre - along, body.centre + along])
    across = body.across * body.depth_m / 2
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return np.stack([body.centre + a * along + b * across for a, b in signs])


def _angle(edge: _Edge, ways: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Angles from the first face through the air to directions, 0 to 2π. [rad].

    The first face of a corner leads onward counter-clockwise; the air is on its right.
    """
    along = edge.inward[0]
    right = np.array([along[1], -along[0], 0.0])
    angle = np.arctan2(ways @ right, ways @ along)
    return np.asarray(np.remainder(angle, 2 * np.pi))


def _facets_do(
    edge: _Edge,
    scene: RadioScene,
    incident: Float[np.ndarray, " 1"],
    outgoing: Float[np.ndarray, " n"],
) -> np.ndarray:
    """Return for which elements the facets of a conductor already radiate the diffracted wave."""
    if not edge.conducts or scene.scenario.max_bounces == 0:
        return np.zeros(outgoing.shape, dtype=bool)
    if len(edge.inward) == 1:  # a plate: both before it, or both behind
        return np.asarray((incident < np.pi) == (outgoing < np.pi))
    first = (incident < np.pi) & (outgoing < np.pi)
    last = edge.exterior * np.pi
    second = (incident > last - np.pi) & (outgoing > last - np.pi)
    return np.asarray(first | second)
