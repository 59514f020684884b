r"""Echo and pilot scattered by ideal points: the radar equation, each leg tested for occlusion.

.. math:: S = \frac{\lambda \sqrt{\sigma}}{(4\pi)^{3/2} R_t R_r} g_t g_r e^{-jk(R_t + R_r)}

Only direct legs count: no scattering between points, none over mirrors. Scattering by a point is
not a bounce: it is included with ``max_bounces = 0``, too. Points preserve polarization: between
antennas of different ones the amplitude has the cosine of the angle between their axes as factor.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from scenes.scenario import User
from scenes.schema.antenna import Antenna
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.polarization import Polarization, antenna_polarization
from simulator.geometry.ray_scene import blocked
from simulator.geometry.slabs import sets_among
from simulator.materials.slab_insertion import along_field, through_slabs
from simulator.scene.radio_scene import RadioScene


class _Leg(NamedTuple):
    axis: Float[np.ndarray, " 3"]  # of the antenna's polarization
    gains: Complex[np.ndarray, "places freqs"]
    """Product of the antenna's pattern and the slabs' transmission, 0 if occluded. [-]"""

    distances: Float[np.ndarray, " places"]  # [m]


def point_echo(scene: RadioScene) -> Complex[np.ndarray, "positions freqs"]:
    """Simulate the echo of a scenario's points at each position of the array.

    Returns
    -------
    S-parameter at each position of the array. [-]
    """
    total = _nothing(scene)
    for target in scene.scenario.points.values():
        back = _array_leg(scene, target.position)
        outward, station = back, scene.scenario.base_station
        places = station.transmit_positions(scene.elements)
        if places is not None:
            aims = scene.scenario.transmit_aims(places)
            outward = _leg(scene, station.transmit_antenna, places, aims, target.position)
        total += _link(scene, outward, back, target.rcs_m2)
    return total


def point_uplink(scene: RadioScene, user: User) -> Complex[np.ndarray, "elements freqs"]:
    """Simulate a user's pilot scattered by a scenario's points.

    Returns
    -------
    S-parameter at each element. [-]
    """
    total = _nothing(scene)
    for target in scene.scenario.points.values():
        place = user.position[None]
        aims = scene.scenario.aim(user.antenna, user.position)[None]
        outward = _leg(scene, user.antenna, place, aims, target.position)
        total += _link(scene, outward, _array_leg(scene, target.position), target.rcs_m2)
    return total


def _nothing(scene: RadioScene) -> Complex[np.ndarray, "elements freqs"]:
    shape = (len(scene.elements), scene.scenario.radio.points)
    return np.zeros(shape, dtype=np.complex128)


def _array_leg(scene: RadioScene, point: Float[np.ndarray, " 3"]) -> _Leg:
    aims = scene.scenario.element_aims(scene.elements)
    return _leg(scene, scene.scenario.base_station.antenna, scene.elements, aims, point)


def _leg(
    scene: RadioScene,
    antenna: Antenna,
    places: Float[np.ndarray, "places 3"],
    aims: Float[np.ndarray, "places 3"],
    point: Float[np.ndarray, " 3"],
) -> _Leg:
    towards = point - places
    distances = np.linalg.norm(towards, axis=-1)
    gains = field_gain(antenna, aims, towards / distances[:, None])
    ends = np.broadcast_to(point, places.shape)
    hidden = blocked(scene.rays, places, ends)
    axis = antenna_polarization(antenna, aims[0]).axis
    frequencies = scene.scenario.radio.frequencies
    fields = np.where(hidden, 0.0, gains)[:, None] * np.ones(frequencies.size, dtype=np.complex128)
    crossed = scene.slabs.crossed(places, ends)
    for slabs in sets_among(crossed, ~hidden):
        some = np.flatnonzero(crossed == slabs)
        ways = towards[some] / distances[some, None]
        fields[some] *= _inserted(scene, slabs, ways, distances[some], axis)
    return _Leg(axis, fields, distances)


def _inserted(
    scene: RadioScene,
    slabs: int,
    ways: Float[np.ndarray, "some 3"],
    distances: Float[np.ndarray, " some"],
    axis: Float[np.ndarray, " 3"],
) -> Complex[np.ndarray, "some freqs"]:
    """Return the slabs' transmission along a leg. [-]."""
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
