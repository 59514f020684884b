"""Scattering by the facets of a scene over one surface, in line of sight or through slabs."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Complex

from simulator.antennas.ports import Ports
from simulator.geometry.facets import Facets
from simulator.scattering.physical_optics import scattered
from simulator.scene.radio_scene import RadioScene


def over_one_surface(
    scene: RadioScene,
    facets: Facets,
    transmit: Ports,
    receive: Ports,
    *,
    advance: Callable[[], None],
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the facets' scattering for each link, directly and through each set of slabs.

    Parameters
    ----------
    scene
        The frozen scene.
    facets
        Its facets.
    transmit, receive
        As for :func:`simulator.scattering.physical_optics.scattered`.
    advance
        Called for each link.

    Returns
    -------
    S-parameter of each link; with cylindrical waves, field per unit line source. [-]
    """
    scenario = scene.scenario
    out = transmit.ways
    back = out if receive is transmit else receive.ways
    total: np.ndarray | None = None
    for there in out:
        for here in back:
            # For an antenna, each facet is behind one set of slabs only.
            if receive is transmit and here is not there:
                continue
            if total is not None and not (there.visible & here.visible).any():
                continue
            part = scattered(
                facets,
                there,
                here,
                scenario.radio.frequencies,
                waves=scenario.waves,
                advance=advance if total is None else _nobody,
            )
            total = part if total is None else total + part
    return np.asarray(total)


def _nobody() -> None:
    """Tell nobody."""
