"""A user's pilot on the direct path to the array: in line of sight, or through slabs."""

import numpy as np
from jaxtyping import Complex, Float

from scenes.scenario import User
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.polarization import antenna_polarization
from simulator.materials.slab_insertion import through_slabs, transported_through
from simulator.scene.radio_scene import RadioScene
from simulator.specular.free_space import direct_wave
from simulator.visibility.line_of_sight import in_line_of_sight


def direct_pilot(scene: RadioScene, user: User) -> Complex[np.ndarray, "elements freqs"]:
    """Simulate a user's pilot on the direct path.

    Parameters
    ----------
    scene
        The frozen scene.
    user
        The transmitting user.

    Returns
    -------
    S-parameter at each element (cylindrical waves: field); 0 behind opaque surfaces. [-]
    """
    scenario, station = scene.scenario, scene.scenario.base_station
    elements, frequencies = scene.elements, scenario.radio.frequencies
    if not scenario.effects.line_of_sight:
        return np.zeros((len(elements), frequencies.size), dtype=np.complex128)
    towards = elements - user.position
    distances = np.linalg.norm(towards, axis=-1)
    directions = towards / distances[:, None]
    gains = field_gain(user.antenna, scenario.aim(user.antenna, user.position), directions)
    gains = gains * field_gain(
        station.antenna, scenario.aim(station.antenna, elements.mean(axis=0)), -directions
    )
    seen = in_line_of_sight(scene.rays, user.position, elements)
    wave = direct_wave(distances, frequencies, waves=scenario.waves)
    inserted = _inserted(scene, user, directions, distances)
    return np.asarray(np.where(seen, gains, 0.0)[:, None] * inserted * wave)


def _inserted(
    scene: RadioScene,
    user: User,
    directions: Float[np.ndarray, "elements 3"],
    distances: Float[np.ndarray, " elements"],
) -> Complex[np.ndarray, "elements freqs"]:
    """Return the factor of the slabs' transmission and of the polarizations. [-]."""
    scenario, frequencies = scene.scenario, scene.scenario.radio.frequencies
    sent, received = _fields(scene, user, directions)
    total = np.repeat(np.einsum("ex,ex->e", sent, received)[:, None] + 0j, frequencies.size, axis=1)
    starts = np.broadcast_to(user.position, scene.elements.shape)
    crossed = scene.slabs.crossed(starts, scene.elements)
    for one in np.unique(crossed[crossed > 0]).tolist():
        some, crossings = np.flatnonzero(crossed == one), scene.slabs.crossings(one)
        ways = directions[some], distances[some]
        if scenario.dimensions == 2:
            total[some] = through_slabs(
                crossings,
                *ways,
                frequencies,
                vertical=scenario.radio.polarization == "vertical",
                cylindrical=scenario.waves == "cylindrical",
            )
        else:
            field = np.repeat(sent[some, None] + 0j, frequencies.size, axis=1)
            arrived = transported_through(crossings, *ways, frequencies, field)
            total[some] = np.einsum("efx,ex->ef", arrived, received[some])
    return np.asarray(total)


def _fields(
    scene: RadioScene, user: User, directions: Float[np.ndarray, "elements 3"]
) -> tuple[Float[np.ndarray, "elements 3"], Float[np.ndarray, "elements 3"]]:
    """Return unit vectors of the user's field, and of the field that the array receives."""
    scenario, station = scene.scenario, scene.scenario.base_station
    if scenario.dimensions == 2:
        upright = np.tile([0.0, 0.0, 1.0], (len(directions), 1))
        return upright, upright
    middle = scene.elements.mean(axis=0)
    sent = antenna_polarization(user.antenna, scenario.aim(user.antenna, user.position))
    received = antenna_polarization(station.antenna, scenario.aim(station.antenna, middle))
    return sent.field(directions), received.field(-directions)
