"""Links over the facets of a scene in space, of any number: in reach, seen, and summed."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Complex

from simulator.antennas.beam_culling import AntennaGroup, in_reach
from simulator.antennas.links import Links
from simulator.scattering.patch_sum import scattered_by_patches
from simulator.scene.radio_scene import RadioScene
from simulator.visibility.shaft_culling import Sightlines, object_shape, scenario_obstacles


def scattered_in_space(
    scene: RadioScene,
    send: AntennaGroup,
    receive: AntennaGroup,
    *,
    advance: Callable[[], None] = lambda: None,
) -> Complex[np.ndarray, "links freqs"]:
    """Sum what the facets scatter from one or several antennas to each of the array.

    Parameters
    ----------
    scene
        The frozen scene.
    send, receive
        Pairwise; a single sender serves all receivers. The same object: echoes.
    advance
        Called for each receiver.

    Returns
    -------
    S-parameter of each link. [-]
    """
    frequencies = scene.scenario.radio.frequencies
    if scene.facets is None:
        return np.zeros((len(receive.positions), frequencies.size), dtype=np.complex128)
    receivers, senders = receive.positions, send.positions
    if send is not receive:
        senders = np.broadcast_to(senders, receivers.shape)
    spectrum: np.ndarray = scattered_by_patches(
        scene.facets,
        Links(senders=senders, receivers=receivers, sent=send.pattern, received=receive.pattern),
        sightlines(scene, send, receive),
        frequencies,
        chosen=in_reach([(send, receive)], scene.facets.centres, 0.0),
        advance=advance,
    )
    return spectrum


def sightlines(scene: RadioScene, send: AntennaGroup, receive: AntennaGroup) -> Sightlines:
    """Tell what links see of a scene's facets."""
    if scene.facets is None:
        raise ValueError("the scene has no facets; give a scene with a scattering object")
    known = list(scene.scenario.objects)
    return Sightlines(
        rays=scene.rays,
        facets=scene.facets,
        senders=send.positions,
        receivers=receive.positions,
        obstacles=scenario_obstacles(scene.scenario),
        shapes=[object_shape(scene.scenario, name) for name in scene.scattering],
        objects=[known.index(name) for name in scene.scattering],
    )
