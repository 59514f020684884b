r"""Echoes and pilots in space over several surfaces: targets over mirrors, and flat faces.

A target (a curved body of any size, or another that is no plate, of at most
:data:`simulator.scene.scene_mirrors.LARGEST_TARGET`) is lit over legs: directly, or over
mirrors. Its facets scatter what comes over one leg into another: wall-target, target-wall,
wall-target-wall, with the mirrors' reflection at each frequency and the coherent loss of their
roughness. The direct way out and back is left to plain physical optics. Of a chain between two
targets the later one is cut into facets, and the other one is a mirror. What no target is cut in
(corners, tilted plates, bodies that see themselves) is
:mod:`simulator.multibounce.flat_chains_3d`'s.

The diffuse part is that of :mod:`simulator.multibounce.diffuse_echo_3d`.

What is neglected: which part of a target a leg lights is found patch by patch, from one facet of
each; of what comes over mirrors to the target, the part across the field of the antenna's image;
chains of two curved targets.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Int

from simulator.antennas.beam_culling import LEVEL, AntennaGroup, in_reach
from simulator.antennas.links import Links
from simulator.geometry.facets import Facets
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.patches import cut_into_patches, patch_side
from simulator.geometry.ray_scene import blocked
from simulator.materials.facet_reflection import reflection_nodes
from simulator.materials.slab_insertion import LEAST_LEVEL, passage_level, passage_nodes
from simulator.multibounce.diffuse_echo_3d import diffuse_echo
from simulator.multibounce.flat_chains_3d import over_flat_faces
from simulator.scattering.patch_sum import COEFFICIENT_ACCURACY, scattered_by_patches
from simulator.scene.radio_scene import RadioScene
from simulator.scene.scene_mirrors import SceneMirrors
from simulator.specular.image_method import trace_chain
from simulator.specular.image_sources import DIRECT, Leg, LegReflection
from simulator.specular.path_field import Through
from simulator.visibility.seen import Seen


def echo_over_mirrors(
    scene: RadioScene, send: AntennaGroup, receive: AntennaGroup
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the echoes over two and more surfaces, up to the scenario's ``max_bounces``.

    Coherent and diffuse: see :func:`coherent_echo` and
    :mod:`simulator.multibounce.diffuse_echo_3d`.
    """
    return np.asarray(coherent_echo(scene, send, receive) + diffuse_echo(scene, send, receive))


def coherent_echo(
    scene: RadioScene, send: AntennaGroup, receive: AntennaGroup
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the coherent part of the echoes over two and more surfaces.

    Parameters
    ----------
    scene
        The frozen scene.
    send, receive
        The array's antennas, pairwise; the same object if each hears its own echo.

    Returns
    -------
    S-parameter at each antenna. [-]
    """
    among = scene.mirrors
    if among is None:
        shape = (len(receive.positions), scene.scenario.radio.points)
        return np.zeros(shape, dtype=np.complex128)
    echo = _over_targets(scene, among, send, receive)
    flat = _flat_chains(scene, among)
    return np.asarray(echo + over_flat_faces(scene, flat, send, receive))


def coherent_pilot(
    scene: RadioScene, sender: AntennaGroup, receive: AntennaGroup
) -> Complex[np.ndarray, "elements freqs"]:
    """Sum the coherent part of a user's pilot over two and more surfaces.

    Parameters
    ----------
    scene
        The frozen scene.
    sender
        The user's antenna.
    receive
        The array's antennas.

    Returns
    -------
    S-parameter at each element. [-]
    """
    among = scene.mirrors
    if among is None:
        shape = (len(receive.positions), scene.scenario.radio.points)
        return np.zeros(shape, dtype=np.complex128)
    pilot = _over_targets(scene, among, sender, receive)
    # From the user the mirrors of a leg of the array are met in turn; other chains are out of
    # the reach of the array's pattern, whatever the user's.
    flat = [sequence[::-1] for sequence in _flat_chains(scene, among)]
    return np.asarray(pilot + over_flat_faces(scene, flat, sender, receive))


def _flat_chains(scene: RadioScene, among: SceneMirrors) -> list[tuple[int, ...]]:
    """Return the chains of faces by the image method, from the array outward."""
    return [
        leg.sequence
        for leg in among.chains
        if leg.bounces <= scene.scenario.max_bounces
        and among.by_images(leg)
        and scene.facet_target(leg.sequence) is None
    ]


def _over_targets(
    scene: RadioScene, among: SceneMirrors, send: AntennaGroup, receive: AntennaGroup
) -> Complex[np.ndarray, "links freqs"]:
    """Sum what targets' facets scatter from one leg of mirrors into another."""
    frequencies = scene.scenario.radio.frequencies
    total = np.zeros((len(receive.positions), frequencies.size), dtype=np.complex128)
    most = scene.scenario.max_bounces - 1
    for name in among.targets:
        if name not in scene.scattering:
            continue
        own = among.of(name)
        legs = [DIRECT, *(leg for leg in among.legs if not own.intersection(leg.sequence))]
        target = _Target(scene, among.mirrors, scene.facets_of(name), send, receive)
        leads = [target.lit_over(leg, send) for leg in legs]
        heard = leads if send is receive else [target.lit_over(leg, receive) for leg in legs]
        bounces = np.array([leg.bounces for leg in legs])
        together = bounces[:, None] + bounces
        wanted = (together >= 1) & (together <= most)
        if send is receive:  # the same way the other way round
            wanted = np.triu(wanted)
        for out, back in np.argwhere(wanted).tolist():
            if not (leads[out] and heard[back]):
                continue
            pair = legs[out], legs[back]
            # Over several targets that are mirrors, too: one of them is cut into facets.
            around = (*pair[0].sequence, *pair[1].sequence)
            if own and scene.facet_target((*around, *sorted(own)[:1])) != name:
                continue
            twice = 2.0 if send is receive and out != back else 1.0
            total += twice * target.wave(*pair)
    return total


SAMPLES = 400
"""Facets of a target, spread over it, that tell whether a leg leads there: a leg is missed if it
lights less than one in so many. [-]"""


class _Sight(NamedTuple):
    """Patches that antennas see over a leg through the same slabs."""

    through: Through
    seen: Bool[np.ndarray, "links patches"]


@dataclass(frozen=True)
class _Target:
    scene: RadioScene
    mirrors: Mirrors
    facets: Facets  # its own
    send: AntennaGroup
    receive: AntennaGroup

    def lit_over(self, leg: Leg, sight: AntennaGroup) -> bool:
        """Tell whether a leg leads to the target at all, were nothing in the way, by samples."""
        facets = self.facets.part(
            np.arange(0, self.facets.count, max(1, self.facets.count // SAMPLES))
        )
        image = leg.image(sight)
        reached = in_reach([(image, image)], facets.centres, 0.0, level=LEVEL**2)
        chain = trace_chain(
            self.mirrors,
            leg.sequence,
            sight.outline,
            facets.places[reached],
            blocked=lambda starts, ends: np.zeros(len(starts), dtype=bool),
            clearance=self.scene.rays.clearance,
        )
        return bool(chain.valid.any())

    def wave(self, out: Leg, back: Leg) -> Complex[np.ndarray, "links freqs"]:
        """Sum what the target scatters from one leg into another."""
        scene, facets = self.scene, self.facets
        frequencies = scene.scenario.radio.frequencies
        links_count = len(self.receive.positions)
        nothing = np.zeros((links_count, frequencies.size), dtype=np.complex128)
        sent = out.image(self.send)
        same = self.send is self.receive and out is back
        heard = sent if same else back.image(self.receive)
        chosen = in_reach([(sent, heard)], facets.centres, 0.0)
        if not chosen.any():
            return nothing
        patches = cut_into_patches(
            facets,
            np.flatnonzero(chosen),
            patch_side(facets, float(frequencies[-1] - frequencies[0])),
        )
        patch_of = np.full(facets.count, -1)
        patch_of[patches.order] = np.repeat(np.arange(patches.count), np.diff(patches.first))
        places = sent.positions
        if len(places) == 1:
            places = np.repeat(places, links_count, axis=0)
        links = Links(
            senders=places,
            receivers=places if same else heard.positions,
            sent=sent.pattern,
            received=sent.pattern if same else heard.pattern,
        )
        there = self._sights(out, self.send, patches.order, patches.first)
        here = there if same else self._sights(back, self.receive, patches.order, patches.first)
        spectrum = nothing
        for one, other in product(there, here):
            seen = one.seen & other.seen
            if not seen.any():
                continue
            spectrum += scattered_by_patches(
                facets,
                links,
                partial(_look_up, seen, patch_of),
                frequencies,
                chosen=chosen,
                factor=LegReflection(
                    mirrors=self.mirrors, out=out, back=back, through=(one.through, other.through)
                ),
                factor_nodes=self._nodes(out, back, (one.through, other.through)),
            )
        return spectrum

    def _nodes(self, out: Leg, back: Leg, through: tuple[Through, Through]) -> int:
        """Count the frequencies at which mirrors and slabs have to be known."""
        frequencies = self.scene.scenario.radio.frequencies
        start, stop = float(frequencies[0]), float(frequencies[-1])
        nodes = 3  # the loss of roughness
        for mirror in (*out.sequence, *back.sequence):
            material = self.mirrors.materials[mirror]
            nodes += reflection_nodes(material, start, stop, accuracy=COEFFICIENT_ACCURACY) - 1
        slabs = [one for leg in through for part in leg for one in part]
        return nodes + passage_nodes(slabs, start, stop) - 1

    def _sights(
        self,
        leg: Leg,
        sight: AntennaGroup,
        order: Int[np.ndarray, " facets"],
        first: Int[np.ndarray, " patches_and_one"],
    ) -> list[_Sight]:
        """Trace one facet of each patch over a leg, from every antenna: what faces them most."""
        facets = self.facets.part(order)
        towards = leg.image(sight).centre - facets.centres
        facing = np.abs(np.einsum("fx,fx->f", towards, facets.mean_normals))
        front = facets.two_sided | (np.einsum("fx,fx->f", towards, facets.mean_normals) > 0)
        facing = np.where(front, facing, -1.0)
        most = np.repeat(np.maximum.reduceat(facing, first[:-1]), np.diff(first))
        candidates = np.flatnonzero(facing == most)
        patch_of = np.repeat(np.arange(len(first) - 1), np.diff(first))[candidates]
        best = candidates[np.unique(patch_of, return_index=True)[1]]
        chain = trace_chain(
            self.mirrors,
            leg.sequence,
            sight.positions,
            facets.places[best],
            blocked=partial(blocked, self.scene.rays),
            clearance=self.scene.rays.clearance,
            receiver_offsets=self.scene.rays.clearance * facets.mean_normals[best],
            slabs=self.scene.slabs,
        )
        if chain.crossed is None:
            return [_Sight((), chain.valid)]
        sights = []
        frequencies = self.scene.scenario.radio.frequencies
        kinds, kind = np.unique(chain.crossed, axis=0, return_inverse=True)
        for index, sets in enumerate(kinds.tolist()):
            through = tuple(self.scene.slabs.crossings(one) for one in sets)
            if passage_level([one for part in through for one in part], frequencies) >= LEAST_LEVEL:
                seen = np.zeros(chain.valid.shape, dtype=bool)
                seen[chain.valid] = kind.ravel() == index
                sights.append(_Sight(through, seen))
        return sights


def _look_up(
    seen: Bool[np.ndarray, "links patches"],
    patch_of: Int[np.ndarray, " facets"],
    some: Int[np.ndarray, " some"],
) -> Seen:
    """Tell what is seen of some facets from what is seen of their patches."""
    always, ever = np.asarray(seen.all(axis=0)), np.asarray(seen.any(axis=0))
    patches = patch_of[some]
    mixed = np.flatnonzero((ever & ~always)[patches])
    return Seen(
        always=always[patches],
        sometimes=mixed,
        table=np.ascontiguousarray(seen[:, patches[mixed]].T),
    )
