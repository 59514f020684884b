"""The monostatic echo: each antenna position transmits, and receives what the facets return."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Complex

from simulator.physical_optics import Ports, scattered
from simulator.radio_scene import RadioScene


def simulate_echo(
    scene: RadioScene, array: Ports | None, *, advance: Callable[[], None]
) -> Complex[np.ndarray, "positions freqs"]:
    """Simulate the noise-free echo over one bounce.

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
    return scattered(scene.facets, array, array, frequencies, waves=scenario.waves, advance=advance)
