r"""The echo over several surfaces in 3-D: targets seen over mirrors, and chains of mirrors alone.

A target (a body other than a plate, of at most
:data:`simulator.scene.scene_mirrors.LARGEST_TARGET`) is illuminated over legs: directly, or over
mirrors. Its facets scatter from one leg into another: wall-target, target-wall, wall-target-wall,
with the mirrors' reflection at each frequency and the coherent loss of their roughness. The direct
echo is left to plain physical optics. In a chain between two targets, the later one is of facets
and the earlier one is a mirror. Chains without a target (three walls of a corner) are images of the
antenna itself.

The diffuse part is that of :mod:`simulator.multibounce.diffuse_echo_3d`.

Approximations: visibility of a target over a leg is traced at one facet of each patch; the field
over mirrors has only the component along the field of the antenna's image; chains of two targets
of which the earlier is curved are left out.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from simulator.antennas.beam_culling import LEVEL, AntennaGroup, in_reach
from simulator.antennas.links import Links
from simulator.geometry.facets import Facets
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.patches import cut_into_patches, patch_side
from simulator.geometry.ray_scene import blocked
from simulator.materials.facet_reflection import reflection_nodes
from simulator.materials.slab_insertion import LEAST_LEVEL, passage_level, passage_nodes
from simulator.multibounce.diffuse_echo_3d import diffuse_echo
from simulator.scattering.patch_sum import COEFFICIENT_ACCURACY, scattered_by_patches
from simulator.scene.radio_scene import RadioScene
from simulator.scene.scene_mirrors import SceneMirrors
from simulator.specular.free_space import direct_wave
from simulator.specular.image_method import trace_chain, unfolded_chain
from simulator.specular.image_sources import DIRECT, Leg, LegReflection
from simulator.specular.path_field import Through, reflected_field
from simulator.visibility.seen import Seen

NUDGE = np.array([2e-5, 1.4e-5, 0.9e-5])
"""Displacement of a receiver, either way, to test whether its path meets an edge: farther than
rays are moved off their mirrors, and along no edge of a usual room. [m]"""


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
        The array's antennas, linked pairwise; the same object for monostatic echoes.

    Returns
    -------
    S-parameter at each antenna. [-]
    """
    frequencies = scene.scenario.radio.frequencies
    echo = np.zeros((len(receive.positions), frequencies.size), dtype=np.complex128)
    most = scene.scenario.max_bounces - 1
    among = scene.mirrors
    if among is None:
        return echo
    order = {name: index for index, name in enumerate(scene.scattering)}
    names = [name for name in among.targets if name in order]
    for name in names:
        facets = scene.facets_of(name)
        own = among.of(name)
        legs = [DIRECT, *(leg for leg in among.legs if not own.intersection(leg.sequence))]
        target = _Target(scene, among.mirrors, facets, send, receive)
        bounces = np.array([leg.bounces for leg in legs])
        together = bounces[:, None] + bounces
        wanted = (together >= 1) & (together <= most)
        if send is receive:  # each path is also traversed in reverse
            wanted = np.triu(wanted)
        for out, back in np.argwhere(wanted).tolist():
            pair = legs[out], legs[back]
            # The chain ends at another target, too: it is evaluated at the later one.
            ends = [leg.sequence[0] for leg in pair if leg.sequence]
            other = among.owners[ends[0]]
            if len(ends) == 1 and own and other in names and order[other] > order[name]:
                continue
            twice = 2.0 if send is receive and out != back else 1.0
            echo += twice * target.echo(*pair)
    return np.asarray(echo + _over_mirrors_alone(scene, among, send, receive))


class _Sight(NamedTuple):
    """Visibility of patches over a leg through one set of slabs."""

    through: Through
    seen: Bool[np.ndarray, "links patches"]


@dataclass(frozen=True)
class _Target:
    scene: RadioScene
    mirrors: Mirrors
    facets: Facets  # its own
    send: AntennaGroup
    receive: AntennaGroup

    def echo(self, out: Leg, back: Leg) -> Complex[np.ndarray, "links freqs"]:
        """Sum the target's scattering from one leg into another."""
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
        """Count the frequencies at which the factor of mirrors and slabs is sampled."""
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
        """Trace one facet of each patch over a leg: the one that faces the antennas most."""
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
    """Return the visibility of some facets: that of their patches."""
    always, ever = np.asarray(seen.all(axis=0)), np.asarray(seen.any(axis=0))
    patches = patch_of[some]
    mixed = np.flatnonzero((ever & ~always)[patches])
    return Seen(
        always=always[patches],
        sometimes=mixed,
        table=np.ascontiguousarray(seen[:, patches[mixed]].T),
    )


def _over_mirrors_alone(
    scene: RadioScene, among: SceneMirrors, send: AntennaGroup, receive: AntennaGroup
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the chains that return to the array over mirrors, without a target.

    Chains over a single mirror only where its body has no facets.
    """
    frequencies = scene.scenario.radio.frequencies
    echo = np.zeros((len(receive.positions), frequencies.size), dtype=np.complex128)
    mirrors = among.mirrors
    for leg in among.chains:
        over_target = any(among.owners[mirror] in among.targets for mirror in leg.sequence)
        if over_target or not among.by_images(leg):
            continue
        image = leg.image(send)
        towards = receive.positions - image.positions
        lengths = np.sqrt(np.einsum("lx,lx->l", towards, towards))
        if not lengths.all():  # two faces of one plane: the image is the antenna itself
            continue
        directions = towards / lengths[:, None]
        gains = image.pattern.towards(directions) * receive.pattern.towards(-directions)
        peak = send.pattern.peak * receive.pattern.peak
        if gains.max(initial=0.0) < LEVEL * peak:
            continue
        some = np.flatnonzero(gains >= LEVEL * peak)
        shares, crossed = _shares(
            scene, mirrors, leg, send.positions[some], receive.positions[some]
        )
        some, shares, crossed = some[shares > 0.0], shares[shares > 0.0], crossed[shares > 0.0]
        if some.size == 0:
            continue
        kinds, kind = np.unique(crossed, axis=0, return_inverse=True)
        for index, sets in enumerate(kinds.tolist()):
            alike = np.flatnonzero(kind.ravel() == index)
            here = some[alike]
            chain = unfolded_chain(
                mirrors, leg.sequence, image.positions[here], receive.positions[here], paired=True
            )
            field = reflected_field(
                mirrors,
                chain,
                frequencies,
                sent=send.pattern.polarization,
                received=receive.pattern.polarization,
                through=tuple(scene.slabs.crossings(one) for one in sets),
            )
            wave = direct_wave(lengths[here], frequencies, waves="spherical")
            echo[here] += (shares[alike] * gains[here])[:, None] * field * wave
    return echo


def _shares(
    scene: RadioScene,
    mirrors: Mirrors,
    leg: Leg,
    sources: Float[np.ndarray, "links 3"],
    receivers: Float[np.ndarray, "links 3"],
) -> tuple[Float[np.ndarray, " links"], Int[np.ndarray, "links legs"]]:
    """Return the weights of a leg's paths, 0 or 1, and 1/2 on an edge; and the slabs crossed.

    Between two walls at right angles, the path back to the antenna meets their common edge. Both
    orders of the walls then have the weight 1/2, as in physical optics: half of the Fresnel zone is
    on either wall. The second result is the set of slabs on each part of the path.
    """
    shares = np.zeros(len(sources))
    crossed = np.zeros((len(sources), leg.bounces + 1), dtype=np.int64)
    for side in (1.0, -1.0):
        chain = trace_chain(
            mirrors,
            leg.sequence,
            sources,
            receivers + side * NUDGE,
            blocked=partial(blocked, scene.rays),
            clearance=scene.rays.clearance,
            paired=True,
            slabs=scene.slabs,
        )
        valid = np.diagonal(chain.valid)
        shares += 0.5 * valid
        if chain.crossed is not None:
            crossed[valid] = chain.crossed
    return shares, crossed
