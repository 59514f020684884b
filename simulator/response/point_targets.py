r"""What ideal points scatter: the radar equation, over every way there and back.

.. math:: S = \frac{\lambda \sqrt{\sigma}}{(4\pi)^{3/2} R_t R_r} g_t g_r e^{-jk(R_t + R_r)}

A way leads straight to the point or over mirrors (walls, boxes, meshes of few faces), with these's
reflection and the coherent loss of their roughness; each part is tested for occlusion, and slabs
let through what they do. Out and back together meet at most ``max_bounces`` mirrors: points are no
surfaces, and what they return is no bounce, so that they are there with ``max_bounces = 0``, too.
Points do not see each other. They keep the polarization: between antennas of different ones, the
cosine of the angle between their axes counts, of an antenna's image that of the image's.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from scenes.scenario import User
from scenes.schema.antenna import Antenna
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.polarization import Polarization, antenna_polarization
from simulator.geometry.mean_surfaces import mean_mirrors, mean_surfaces
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.ray_scene import blocked
from simulator.geometry.slabs import sets_among
from simulator.materials import fresnel_slab
from simulator.materials.slab_insertion import along_field, through_slabs
from simulator.scene.radio_scene import RadioScene, scenario_materials
from simulator.specular.image_method import Chain, find_chains
from simulator.specular.image_sources import DIRECT
from simulator.specular.path_field import reflected_field, roughness_loss


class _Leg(NamedTuple):
    bounces: int  # mirrors on the way
    axis: Float[np.ndarray, " 3"]  # of the antenna's polarization, or its image's
    gains: Complex[np.ndarray, "places freqs"]
    """Of the antenna, of mirrors and of slabs on the way, 0 where there is none. [-]"""

    distances: Float[np.ndarray, " places"]  # along it [m]


class _Antennas(NamedTuple):
    antenna: Antenna
    places: Float[np.ndarray, "places 3"]
    aims: Float[np.ndarray, "places 3"]


def point_echo(scene: RadioScene) -> Complex[np.ndarray, "positions freqs"]:
    """Simulate the echo of a scenario's points, each position on its own.

    Returns
    -------
    S-parameter at each position of the array. [-]
    """
    total, station = _nothing(scene), scene.scenario.base_station
    if not scene.scenario.points:
        return total
    mirrors, array = _mirrors(scene), _array(scene)
    places = station.transmit_positions(scene.elements)
    for target in scene.scenario.points.values():
        outward = back = _legs(scene, mirrors, array, target.position)
        if places is not None:
            aims = scene.scenario.transmit_aims(places)
            senders = _Antennas(station.transmit_antenna, places, aims)
            outward = _legs(scene, mirrors, senders, target.position)
        total += _links(scene, outward, back, target.rcs_m2)
    return total


def point_uplink(scene: RadioScene, user: User) -> Complex[np.ndarray, "elements freqs"]:
    """Simulate what a scenario's points scatter of a user's pilot.

    Returns
    -------
    S-parameter at each element. [-]
    """
    total = _nothing(scene)
    if not scene.scenario.points:
        return total
    mirrors, array = _mirrors(scene), _array(scene)
    aims = scene.scenario.aim(user.antenna, user.position)[None]
    sender = _Antennas(user.antenna, user.position[None], aims)
    for target in scene.scenario.points.values():
        outward = _legs(scene, mirrors, sender, target.position)
        total += _links(
            scene, outward, _legs(scene, mirrors, array, target.position), target.rcs_m2
        )
    return total


def _nothing(scene: RadioScene) -> Complex[np.ndarray, "elements freqs"]:
    shape = (len(scene.elements), scene.scenario.radio.points)
    return np.zeros(shape, dtype=np.complex128)


def _array(scene: RadioScene) -> _Antennas:
    aims = scene.scenario.element_aims(scene.elements)
    return _Antennas(scene.scenario.base_station.antenna, scene.elements, aims)


def _mirrors(scene: RadioScene) -> Mirrors | None:
    """Return the flat faces that ways to points may lead over."""
    scenario = scene.scenario
    if scenario.max_bounces == 0:
        return None
    if scene.mirrors is not None:
        return scene.mirrors.mirrors
    return mean_mirrors(scenario, mean_surfaces(scenario), scenario_materials(scenario))


def _legs(
    scene: RadioScene,
    mirrors: Mirrors | None,
    ends: _Antennas,
    point: Float[np.ndarray, " 3"],
) -> list[_Leg]:
    """Find the ways to a point: the straight one, and those over mirrors."""
    legs = [_straight(scene, ends, point)]
    if mirrors is None or not len(mirrors):
        return legs
    chains = find_chains(
        mirrors,
        ends.places,
        point[None],
        blocked=partial(blocked, scene.rays),
        clearance=scene.rays.clearance,
        max_bounces=scene.scenario.max_bounces,
        min_bounces=1,
        slabs=scene.slabs,
    )
    return [*legs, *(_over_mirrors(scene, mirrors, ends, chain) for chain in chains)]


def _over_mirrors(scene: RadioScene, mirrors: Mirrors, ends: _Antennas, chain: Chain) -> _Leg:
    frequencies = scene.scenario.radio.frequencies
    seen = np.flatnonzero(chain.valid[:, 0])
    gains = np.zeros((len(ends.places), frequencies.size), dtype=np.complex128)
    distances = np.ones(len(ends.places))
    distances[seen] = chain.lengths
    gains[seen] = field_gain(ends.antenna, ends.aims[seen], chain.departures)[:, None]
    sent = antenna_polarization(ends.antenna, ends.aims[0])
    image = sent.turned(DIRECT.onward(mirrors, *chain.mirrors).turn)
    sets = np.zeros((len(seen), len(chain.mirrors) + 1), dtype=np.int64)
    if chain.crossed is not None:
        sets = chain.crossed
    kinds, kind = np.unique(sets, axis=0, return_inverse=True)
    for index, one in enumerate(kinds.tolist()):
        some = np.flatnonzero(kind.ravel() == index)
        through = tuple(scene.slabs.crossings(part) for part in one)
        if scene.scenario.dimensions == 2:
            field = _in_the_plane(scene, mirrors, chain, some)
            for leg, crossings in enumerate(through):
                if crossings:
                    ways, lengths = chain.directions[some, leg], chain.lengths[some]
                    field = field * _inserted(scene, one[leg], ways, lengths, sent.axis)
        else:
            field = reflected_field(
                mirrors, _part(chain, some), frequencies, sent=sent, at_place=image, through=through
            )
        gains[seen[some]] *= field
    return _Leg(len(chain.mirrors), image.axis, gains, distances)


def _in_the_plane(
    scene: RadioScene, mirrors: Mirrors, chain: Chain, some: np.ndarray
) -> Complex[np.ndarray, "some freqs"]:
    """Multiply the reflections of a 2-D scene. [-]."""
    frequencies = scene.scenario.radio.frequencies
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    field = np.ones((len(some), frequencies.size), dtype=np.complex128)
    for bounce, mirror in enumerate(chain.mirrors):
        cosines = chain.cosines[some, bounce]
        both = fresnel_slab.reflection(mirrors.materials[mirror], frequencies, cosines)
        field *= both.te if scene.scenario.radio.polarization == "vertical" else both.tm
        field *= roughness_loss(wavenumbers * mirrors.rms_heights[mirror] * cosines[:, None])
    return field


def _part(chain: Chain, some: np.ndarray) -> Chain:
    return Chain(
        mirrors=chain.mirrors,
        valid=np.ones((len(some), 1), dtype=bool),
        lengths=chain.lengths[some],
        vertices=chain.vertices[some],
        cosines=chain.cosines[some],
        directions=chain.directions[some],
    )


def _straight(scene: RadioScene, ends: _Antennas, point: Float[np.ndarray, " 3"]) -> _Leg:
    antenna, places, aims = ends.antenna, ends.places, ends.aims
    towards = point - places
    distances = np.linalg.norm(towards, axis=-1)
    gains = field_gain(antenna, aims, towards / distances[:, None])
    there = np.broadcast_to(point, places.shape)
    hidden = blocked(scene.rays, places, there)
    axis = antenna_polarization(antenna, aims[0]).axis
    frequencies = scene.scenario.radio.frequencies
    fields = np.where(hidden, 0.0, gains)[:, None] * np.ones(frequencies.size, dtype=np.complex128)
    crossed = scene.slabs.crossed(places, there)
    for slabs in sets_among(crossed, ~hidden):
        some = np.flatnonzero(crossed == slabs)
        ways = towards[some] / distances[some, None]
        fields[some] *= _inserted(scene, slabs, ways, distances[some], axis)
    return _Leg(0, axis, fields, distances)


def _inserted(
    scene: RadioScene,
    slabs: int,
    ways: Float[np.ndarray, "some 3"],
    distances: Float[np.ndarray, " some"],
    axis: Float[np.ndarray, " 3"],
) -> Complex[np.ndarray, "some freqs"]:
    """Return what slabs leave of a leg's field. [-]."""
    scenario, crossings = scene.scenario, scene.slabs.crossings(slabs)
    frequencies = scenario.radio.frequencies
    if scenario.dimensions == 2:
        return through_slabs(
            crossings,
            ways,
            distances,
            frequencies,
            vertical=scenario.radio.polarization == "vertical",
            cylindrical=False,
        )
    field = Polarization(axis=axis, cross_polar=0.0).field(ways)
    return along_field(crossings, ways, distances, frequencies, field)


def _links(
    scene: RadioScene, outward: Sequence[_Leg], back: Sequence[_Leg], cross_section: float
) -> Complex[np.ndarray, "elements freqs"]:
    """Sum over all ways out and back."""
    total, most = _nothing(scene), scene.scenario.max_bounces
    for one in outward:
        for other in back:
            if one.bounces + other.bounces <= most:
                total += _link(scene, one, other, cross_section)
    return total


def _link(
    scene: RadioScene, outward: _Leg, back: _Leg, cross_section: float
) -> Complex[np.ndarray, "elements freqs"]:
    frequencies = scene.scenario.radio.frequencies
    wavelengths = speed_of_light / frequencies
    match = float((outward.axis * back.axis).sum())
    spread = (match / (outward.distances * back.distances))[:, None]
    amplitude = wavelengths * np.sqrt(cross_section) / (4 * np.pi) ** 1.5
    turns = (outward.distances + back.distances)[:, None] / wavelengths
    phase = np.exp(-2j * np.pi * np.remainder(turns, 1.0))
    link: np.ndarray = spread * outward.gains * back.gains * amplitude * phase
    return link
