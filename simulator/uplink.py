"""A user's pilot at the array: the line of sight, and what the facets scatter of it."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Complex

from scenes.scenario import User
from simulator.antennas import field_gain
from simulator.free_space import direct_wave
from simulator.ghost_echo import uplink_over_surfaces
from simulator.line_of_sight import in_line_of_sight
from simulator.physical_optics import Ports, scattered
from simulator.radio_scene import RadioScene, facet_ports


def simulate_uplink(
    scene: RadioScene, user: User, array: Ports | None, *, advance: Callable[[], None]
) -> Complex[np.ndarray, "elements freqs"]:
    """Simulate one user's noise-free pilot: direct, over one bounce, in 2-D also over more.

    Over a single rough mirror the facets give the coherent and the diffuse part at once, so
    that no specular leg is added to them.

    Parameters
    ----------
    scene
        The frozen scene.
    user
        Transmits.
    array
        Ports of the array; ``None`` if nothing scatters.
    advance
        Called for each element that is done.

    Returns
    -------
    S-parameter at each element (cylindrical waves: field). [-]
    """
    pilot: np.ndarray = _direct(scene, user)
    if array is None or scene.facets is None:
        return pilot
    port = facet_ports(scene, scene.facets, user.antenna, user.position[None, :])
    over_walls: np.ndarray = scattered(
        scene.facets,
        port,
        array,
        scene.scenario.radio.frequencies,
        waves=scene.scenario.waves,
        advance=advance,
    )
    both: np.ndarray = pilot + over_walls
    if not scene.facets.flat:
        return both
    over_several: np.ndarray = uplink_over_surfaces(
        scene.mutual_visibility.faces,
        scene.mutual_visibility,
        port,
        array,
        scene.scenario.radio.frequencies,
        waves=scene.scenario.waves,
        max_bounces=scene.scenario.max_bounces,
    )
    return np.asarray(both + over_several)


def _direct(scene: RadioScene, user: User) -> Complex[np.ndarray, "elements freqs"]:
    scenario, station = scene.scenario, scene.scenario.base_station
    elements = scene.elements
    towards = elements - user.position
    distances = np.linalg.norm(towards, axis=-1)
    directions = towards / distances[:, None]
    gains = field_gain(user.antenna, scenario.aim(user.antenna, user.position), directions)
    gains = gains * field_gain(
        station.antenna, scenario.aim(station.antenna, elements.mean(axis=0)), -directions
    )
    seen = in_line_of_sight(scene.rays, user.position, elements)
    wave = direct_wave(distances, scenario.radio.frequencies, waves=scenario.waves)
    return np.asarray(np.where(seen, gains, 0.0)[:, None] * wave)
