"""The echo: each position transmits, and receives at the same or a neighbouring place."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Complex

from simulator.antennas.polarization import antenna_polarization
from simulator.antennas.ports import Ports
from simulator.geometry.facets import Facets
from simulator.geometry.ray_scene import facets_visible
from simulator.multibounce.multibounce_2d import SeveralProgress, ghost_echo, untold
from simulator.multibounce.multibounce_3d import echo_over_mirrors
from simulator.response.over_one_surface import over_one_surface
from simulator.response.single_bounce_3d import scattered_in_space
from simulator.scattering.physical_optics import scattered
from simulator.scene.array_antennas import array_group, in_space, sending_group
from simulator.scene.radio_scene import RadioScene, antenna_pattern, facet_ports


def simulate_echo(
    scene: RadioScene,
    array: Ports | None,
    *,
    advance: Callable[[], None],
    over_several: SeveralProgress = untold,
) -> Complex[np.ndarray, "positions freqs"]:
    """Simulate the noise-free echo: over one surface, and over up to ``max_bounces``.

    Parameters
    ----------
    scene
        The frozen scene.
    array
        Ports of the array; ``None`` if nothing scatters, or if transmitters are separate.
    advance
        Called after each position.
    over_several
        Called with the progress of the part over several surfaces.

    Returns
    -------
    S-parameter at each position of the array (cylindrical waves: field). [-]
    """
    scenario = scene.scenario
    frequencies = scenario.radio.frequencies
    if scene.facets is not None and scenario.base_station.multistatic:
        return _link_by_link(scene, scene.facets, advance)
    if in_space(scenario):
        array_there = array_group(scenario, scene.elements)
        senders_there = sending_group(scenario, scene.elements) or array_there
        over_one = scattered_in_space(scene, senders_there, array_there, advance=advance)
        return np.asarray(over_one + echo_over_mirrors(scene, senders_there, array_there))
    if array is None or scene.facets is None:
        shape = (scenario.base_station.element_count, frequencies.size)
        return np.zeros(shape, dtype=np.complex128)
    station, senders = scenario.base_station, array
    if station.transmit_offset is not None:
        places = scene.elements + station.transmit_offset
        senders = facet_ports(scene, scene.facets, station.antenna, places)
    echo = over_one_surface(scene, scene.facets, senders, array, advance=advance)
    if not scene.facets.flat or senders is not array:
        return echo
    ghosts: np.ndarray = ghost_echo(
        scene.mutual_visibility.faces,
        scene.mutual_visibility,
        array,
        frequencies,
        waves=scenario.waves,
        max_bounces=scenario.max_bounces,
        progress=over_several,
    )
    return np.asarray(echo + ghosts)


def _link_by_link(
    scene: RadioScene, facets: Facets, advance: Callable[[], None]
) -> Complex[np.ndarray, "positions freqs"]:
    """Sum over one bounce between antennas that have aims of their own."""
    scenario, station = scene.scenario, scene.scenario.base_station
    senders = station.transmit_positions(scene.elements)
    senders = scene.elements if senders is None else senders
    ends = (
        (senders, station.transmit_antenna, scenario.transmit_aims(senders)),
        (scene.elements, station.antenna, scenario.element_aims(scene.elements)),
    )
    rows = []
    for index in range(len(senders)):
        transmit, receive = (
            Ports(
                positions=places[index, None],
                pattern=antenna_pattern(antenna, aims[index]),
                visible=facets_visible(scene.rays, facets, places[index, None]),
                polarization=antenna_polarization(antenna, aims[index]),
            )
            for places, antenna, aims in ends
        )
        row = scattered(facets, transmit, receive, scenario.radio.frequencies, waves=scenario.waves)
        rows.append(row[0])
        advance()
    return np.stack(rows)
