"""The echo: each position transmits, and receives what the facets return, there or beside it."""

from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Complex

from simulator.ghost_echo import ghost_echo, scattering_faces
from simulator.mutual_visibility import facets_see_each_other
from simulator.physical_optics import Ports, scattered
from simulator.radio_scene import RadioScene, facet_ports


def simulate_echo(
    scene: RadioScene, array: Ports | None, *, advance: Callable[[], None]
) -> Complex[np.ndarray, "positions freqs"]:
    """Simulate the noise-free echo: over one bounce, in 2-D also over two and three.

    Parameters
    ----------
    scene
        The frozen scene.
    array
        Ports of the array; ``None`` if nothing scatters.
    advance
        Called for each position that is done.

    Returns
    -------
    S-parameter at each position of the array (cylindrical waves: field). [-]
    """
    scenario = scene.scenario
    frequencies = scenario.radio.frequencies
    if array is None or scene.facets is None:
        shape = (scenario.base_station.element_count, frequencies.size)
        return np.zeros(shape, dtype=np.complex128)
    station, senders = scenario.base_station, array
    if station.transmit_offset is not None:
        places = scene.elements + station.transmit_offset
        senders = facet_ports(scene, scene.facets, station.antenna, places)
    echo: np.ndarray = scattered(
        scene.facets, senders, array, frequencies, waves=scenario.waves, advance=advance
    )
    if not scene.facets.flat or senders is not array:
        return echo
    ghosts: np.ndarray = ghost_echo(
        scattering_faces(scene.facets),
        partial(facets_see_each_other, scene.rays),
        array,
        frequencies,
        waves=scenario.waves,
        max_bounces=scenario.max_bounces,
    )
    return np.asarray(echo + ghosts)
