"""Links over any number of facets of a 3-D scene: selection by beam and visibility, and sum."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Complex, Float

from simulator.antennas.beam_culling import AntennaGroup, in_reach
from simulator.antennas.links import Links
from simulator.antennas.polarization import Polarization
from simulator.materials.slab_insertion import (
    LEAST_LEVEL,
    Crossing,
    along_field,
    passage_level,
    passage_nodes,
)
from simulator.scattering.patch_sum import scattered_by_patches
from simulator.scene.radio_scene import RadioScene
from simulator.visibility.shaft_culling import Sightlines, object_shape, scenario_obstacles
from simulator.visibility.slab_sights import SlabSights


def scattered_in_space(
    scene: RadioScene,
    send: AntennaGroup,
    receive: AntennaGroup,
    *,
    advance: Callable[[], None] = lambda: None,
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the fields scattered by the facets from one or several antennas to each of the array.

    Parameters
    ----------
    scene
        The frozen scene.
    send, receive
        Antennas, linked pairwise; a single sender is linked with all receivers. The same object:
        monostatic echoes.
    advance
        Called for each receiver.

    Returns
    -------
    S-parameter of each link. [-]
    """
    frequencies = scene.scenario.radio.frequencies
    spectrum = np.zeros((len(receive.positions), frequencies.size), dtype=np.complex128)
    if scene.facets is None:
        return spectrum
    receivers, senders = receive.positions, send.positions
    if send is not receive:
        senders = np.broadcast_to(senders, receivers.shape)
    links = Links(senders=senders, receivers=receivers, sent=send.pattern, received=receive.pattern)
    lines = sightlines(scene, send, receive)
    chosen = in_reach([(send, receive)], scene.facets.centres, 0.0)
    if not len(scene.slabs):
        return np.asarray(
            scattered_by_patches(
                scene.facets, links, lines, frequencies, chosen=chosen, advance=advance
            )
        )
    start, stop = float(frequencies[0]), float(frequencies[-1])
    sights = SlabSights(
        slabs=scene.slabs,
        sightlines=lines,
        chosen=np.flatnonzero(chosen),
        convex=[_own_faces(scene, name) for name in scene.scattering],
    )
    for number, pair in enumerate(sights.pairs):
        out, back = (scene.slabs.crossings(one) for one in pair)
        if passage_level((*out, *back), frequencies) < LEAST_LEVEL:
            continue
        nodes = passage_nodes((*out, *back), start, stop)
        spectrum += scattered_by_patches(
            scene.facets,
            links,
            partial(sights.over, pair),
            frequencies,
            chosen=sights.may_be(pair),
            factor=_Insertion(out, back) if out or back else None,
            factor_nodes=nodes,
            advance=advance if number == 0 else _nobody,
        )
    return spectrum


@dataclass(frozen=True)
class _Insertion:
    """Factor of the slabs on both legs in the sum over a patch, taken at the patch's centre."""

    out: tuple[Crossing, ...]
    back: tuple[Crossing, ...]

    def __call__(
        self,
        links: Links,
        centres: Float[np.ndarray, "patches 3"],
        nodes: Float[np.ndarray, " nodes"],
    ) -> Complex[np.ndarray, "patches links nodes"]:
        out, back = (
            partial(_transmitted, slabs, centres, nodes) if slabs else None
            for slabs in (self.out, self.back)
        )
        return links.product_over_legs(out, back, patches=len(centres), nodes=nodes.size)


def _transmitted(
    slabs: tuple[Crossing, ...],
    centres: Float[np.ndarray, "patches 3"],
    nodes: Float[np.ndarray, " nodes"],
    places: Float[np.ndarray, "some 3"],
    polarization: Polarization,
) -> Complex[np.ndarray, "patches some nodes"]:
    towards = (centres[:, None] - places).reshape(-1, 3)
    lengths = np.sqrt(np.einsum("rx,rx->r", towards, towards))
    ways = towards / lengths[:, None]
    inserted = along_field(slabs, ways, lengths, nodes, polarization.field(ways))
    return inserted.reshape(len(centres), -1, nodes.size)


def _own_faces(scene: RadioScene, name: str) -> int:
    """Return the set of faces that never hide an object's own facets: its own, if convex."""
    if object_shape(scene.scenario, name) != "convex":
        return 0
    return sum(1 << face for face, owner in enumerate(scene.slabs.owners) if owner == name)


def _nobody() -> None:
    """Report no progress."""


def sightlines(scene: RadioScene, send: AntennaGroup, receive: AntennaGroup) -> Sightlines:
    """Return the visibility test of a scene's facets for links, among the opaque surfaces."""
    if scene.facets is None:
        raise ValueError("the scene has no facets; give a scene with a scattering object")
    known = list(scene.scenario.objects)
    slabs = {known.index(name) for name in scene.slabs.owners}
    return Sightlines(
        rays=scene.rays,
        facets=scene.facets,
        senders=send.positions,
        receivers=receive.positions,
        obstacles=[o for o in scenario_obstacles(scene.scenario) if o.owner not in slabs],
        shapes=[object_shape(scene.scenario, name) for name in scene.scattering],
        objects=[known.index(name) for name in scene.scattering],
    )
