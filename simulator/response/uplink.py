"""A user's pilot at the array: line of sight, specular chains, and scattering by facets."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Complex

from scenes.scenario import User
from simulator.antennas.beam_culling import AntennaGroup
from simulator.antennas.ports import Ports
from simulator.multibounce.diffuse_field_3d import diffuse_wave
from simulator.multibounce.multibounce_2d import SeveralProgress, untold, uplink_over_surfaces
from simulator.multibounce.multibounce_3d import coherent_pilot
from simulator.response.direct_pilot import direct_pilot
from simulator.response.over_one_surface import over_one_surface
from simulator.response.round_edges import pilot_round_edges
from simulator.response.round_edges_3d import pilot_round_edges_3d
from simulator.response.single_bounce_3d import scattered_in_space
from simulator.scene.array_antennas import array_group, in_space, user_group
from simulator.scene.radio_scene import RadioScene, facet_ports
from simulator.specular.diffuse_chains import diffuse_legs


def simulate_uplink(
    scene: RadioScene,
    user: User,
    array: Ports | None,
    *,
    advance: Callable[[], None],
    over_several: SeveralProgress = untold,
) -> Complex[np.ndarray, "elements freqs"]:
    """Simulate one user's noise-free pilot: direct, over one bounce and over more.

    Over a single rough mirror the facets give the coherent and the diffuse part at once, so
    that no specular leg is added to them.

    Parameters
    ----------
    scene
        The frozen scene.
    user
        The transmitting user.
    array
        Ports of the array; ``None`` if nothing scatters.
    advance
        Called after each element.
    over_several
        Called with the progress of the part over several surfaces.

    Returns
    -------
    S-parameter at each element (cylindrical waves: field). [-]
    """
    pilot: np.ndarray = direct_pilot(scene, user)
    if scene.scenario.effects.diffraction:
        flat = scene.scenario.dimensions == 2
        pilot = pilot + (pilot_round_edges if flat else pilot_round_edges_3d)(scene, user)
    if in_space(scene.scenario):
        name = next(name for name, one in scene.scenario.users.items() if one is user)
        sender, array_there = (
            user_group(scene.scenario, name),
            array_group(scene.scenario, scene.elements),
        )
        over_one = scattered_in_space(scene, sender, array_there, advance=advance)
        over_more_there = coherent_pilot(scene, sender, array_there)
        over_more_there += _diffuse_over_mirrors(scene, sender, array_there)
        return np.asarray(pilot + over_one + over_more_there)
    if array is None or scene.facets is None:
        return pilot
    port = facet_ports(scene, scene.facets, user.antenna, user.position[None, :])
    over_walls = over_one_surface(scene, scene.facets, port, array, advance=advance)
    both: np.ndarray = pilot + over_walls
    if not scene.facets.flat:
        return both
    over_more: np.ndarray = uplink_over_surfaces(
        scene.mutual_visibility.faces,
        scene.mutual_visibility,
        port,
        array,
        scene.scenario.radio.frequencies,
        waves=scene.scenario.waves,
        max_bounces=scene.scenario.max_bounces,
        progress=over_several,
    )
    return np.asarray(both + over_more)


def _diffuse_over_mirrors(
    scene: RadioScene, sender: AntennaGroup, array: AntennaGroup
) -> Complex[np.ndarray, "elements freqs"]:
    """Sum diffuse scattering by one rough mirror of chains of two and more, in 3-D."""
    frequencies, most = scene.scenario.radio.frequencies, scene.scenario.max_bounces
    response = np.zeros((len(array.positions), frequencies.size), dtype=np.complex128)
    if scene.mirrors is None or most < 2:
        return response
    chains = [leg for leg in scene.mirrors.chains if 2 <= leg.bounces <= most]
    for chain in diffuse_legs(scene.mirrors.mirrors, chains):
        response += diffuse_wave(scene, chain, array, sender)
    return response
