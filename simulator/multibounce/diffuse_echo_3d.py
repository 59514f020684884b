r"""The diffuse part of echoes over rough mirrors: targets illuminated by diffuse scattering.

A rough mirror's patches p scatter a wave :math:`W_p(a)` from an antenna a to a scattering centre
:math:`q_0` of the target. The target's response from p to another place b is the sum over its
facets, T(p, b), computed once for all antennas:

.. math:: H(a) = \sum_p W_p(a)\, A(p), \quad A(p) = \frac{T(p, b)}{g(p, q_0)\, g(q_0, b)}

with free-space links g and b the middle of the array, or its image over the other leg. With the
coherent wave C(a) at the centre, diffuse-coherent echoes are H·C; diffuse-diffuse ones
:math:`H H' / A_0`, as if the target's response for two diffuse directions were the product of its
responses for each with the coherent one. :math:`A_0` is the larger of the amplitude in the specular
direction and of its rms over the mirror: exact for a single scattering centre, bounded for any
target.

The centre is the facet with the shortest path between both ends: the specular point of a convex
target.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from scipy.constants import speed_of_light
from scipy.spatial import KDTree

from scenes.schema.antenna import Isotropic
from simulator.antennas.antenna_pattern import AntennaPattern
from simulator.antennas.beam_culling import AntennaGroup
from simulator.antennas.links import Links
from simulator.antennas.polarization import Polarization
from simulator.geometry.facets import Facets
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.patches import cut_into_patches
from simulator.geometry.ray_scene import blocked
from simulator.multibounce.diffuse_field_3d import diffuse_wave, facets_within_reach
from simulator.numerics.nufft_sum import barycentric_basis, chebyshev_nodes
from simulator.scattering.patch_sum import scattered_by_patches
from simulator.scene.radio_scene import RadioScene
from simulator.specular.diffuse_chains import DIFFUSE_LEVEL, DiffuseLeg, diffuse_legs
from simulator.specular.free_space import direct_wave
from simulator.specular.image_method import trace_chain, unfolded_chain
from simulator.specular.image_sources import DIRECT, Leg
from simulator.specular.path_field import reflected_field
from simulator.visibility.seen import Seen

OFF_TARGET = 1e-4
"""Distance of the scattering centre in front of its facet. [m]"""

FEWEST_PLACES = 0.5
"""Spacing of the places on the rough mirror at which a target's response is computed, over λR/D,
for a target of size D at the distance R. [-]"""

MOST_PLACES = 2_500
"""Most places on the rough mirror at which the target's response is computed. [-]"""

ANSWER_NODES = (1, 2, 3, 4, 6, 8, 12, 16, 24)
"""Allowed numbers of frequencies at which a target's response is sampled. [-]"""

ANSWER_ACCURACY = 0.1
"""Relative interpolation error of the response, rms over the mirror: below that of representing a
target by a scattering centre. [-]"""


def diffuse_echo(
    scene: RadioScene, send: AntennaGroup, receive: AntennaGroup
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the echoes of targets over two legs of which at least one is diffuse.

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
    most, among = scene.scenario.max_bounces - 1, scene.mirrors
    if most < 1 or among is None or not among.mirrors.rms_heights.any():
        return echo
    for name in among.targets:
        if name not in scene.scattering:
            continue
        own = among.of(name)
        legs = [DIRECT, *(leg for leg in among.legs if not own.intersection(leg.sequence))]
        target = _Target(scene, among.mirrors, name, scene.facets_of(name))
        rough = list(diffuse_legs(among.mirrors, legs))
        for one in rough:
            for other in legs:
                if one.bounces + other.bounces > most:
                    continue
                partners = [two for two in rough if two.leg is other]
                echo += target.echo(one, other, partners, send, receive)
                if send is not receive:
                    echo += target.echo(one, other, (), receive, send)
    return echo


@dataclass(frozen=True)
class _Target:
    scene: RadioScene
    mirrors: Mirrors
    name: str
    facets: Facets

    def echo(
        self,
        one: DiffuseLeg,
        other: Leg,
        partners: Sequence[DiffuseLeg],
        send: AntennaGroup,
        receive: AntennaGroup,
    ) -> Complex[np.ndarray, "links freqs"]:
        """Sum diffuse-coherent and diffuse-diffuse echoes over two legs.

        Monostatic echoes over two different legs count twice: once with the legs exchanged.
        """
        frequencies = self.scene.scenario.radio.frequencies
        echo = np.zeros((len(receive.positions), frequencies.size), dtype=np.complex128)
        images = one.leg.image(send), other.image(receive)
        ends = np.stack([image.centre for image in images])
        centre = self._centre(ends[0], ends[1])
        if centre is None:
            return echo
        # The arriving field is taken along the field of the antenna's image.
        there, on_return = (
            AntennaGroup(positions=centre[None], pattern=_probe(image)) for image in images
        )
        coherent = self._coherent(other, receive, centre)
        partners = [
            two
            for two in partners
            if facets_within_reach(
                self.scene, two, two.before.image(receive), two.after.image(on_return)
            ).size
        ]
        if coherent is None and not partners:
            return echo
        places = facets_within_reach(
            self.scene, one, one.before.image(send), one.after.image(there)
        )
        if places.size == 0:
            return echo
        fields = there.pattern, images[1].pattern
        answer = self._answer(one, places, centre, ends, fields)
        wave = self._wave(one, send, there, answer)
        if coherent is not None:
            echo += (2.0 if send is receive else 1.0) * wave * coherent
        for two in partners:
            if two is one and send is receive:
                other_wave, reference = wave, answer.reference
            else:
                places = facets_within_reach(
                    self.scene, two, two.before.image(receive), two.after.image(on_return)
                )
                fields = on_return.pattern, images[0].pattern
                back = self._answer(two, places, centre, ends[::-1], fields)
                other_wave = self._wave(two, receive, on_return, back)
                reference = answer.reference
            echo += wave * other_wave / reference
        return echo

    def _wave(
        self, chain: DiffuseLeg, sight: AntennaGroup, there: AntennaGroup, answer: "_Answer"
    ) -> Complex[np.ndarray, "links freqs"]:
        wave: np.ndarray = diffuse_wave(
            self.scene,
            chain,
            sight,
            there,
            beside=self.name,
            factor=answer,
            factor_nodes=answer.nodes,
        )
        return wave

    def _lit(
        self, one: Float[np.ndarray, " 3"], other: Float[np.ndarray, " 3"]
    ) -> Int[np.ndarray, " lit"]:
        facets = self.facets
        sides = [
            np.einsum("fx,fx->f", place - facets.centres, facets.mean_normals)
            for place in (one, other)
        ]
        front: Bool[np.ndarray, " facets"] = facets.two_sided | (sides[0] > 0)
        return np.flatnonzero(front & (sides[0] * sides[1] > 0))

    def _centre(
        self, one: Float[np.ndarray, " 3"], other: Float[np.ndarray, " 3"]
    ) -> Float[np.ndarray, " 3"] | None:
        """Return the point of the target with the shortest path between two places."""
        lit = self._lit(one, other)
        if lit.size == 0:
            return None
        centres = self.facets.centres[lit]
        ways = np.linalg.norm(centres - one, axis=-1) + np.linalg.norm(centres - other, axis=-1)
        best = lit[int(np.argmin(ways))]
        # Off the mean surface, at which rays are tested.
        place, normal = self.facets.places[best], self.facets.mean_normals[best]
        side = np.sign(((one - place) * normal).sum())
        centre: np.ndarray = place + OFF_TARGET * side * normal
        return centre

    def _coherent(
        self, leg: Leg, sight: AntennaGroup, centre: Float[np.ndarray, " 3"]
    ) -> Complex[np.ndarray, "links freqs"] | None:
        """Return the wave over a leg of mirrors at the centre; None without a path."""
        frequencies = self.scene.scenario.radio.frequencies
        image = leg.image(sight)
        towards = centre - image.positions
        lengths = np.sqrt(np.einsum("lx,lx->l", towards, towards))
        gains = image.pattern.towards(towards / lengths[:, None])
        if gains.max() < DIFFUSE_LEVEL * image.pattern.peak:
            return None
        seen = trace_chain(
            self.mirrors,
            leg.sequence,
            sight.positions,
            centre[None],
            blocked=partial(blocked, self.scene.rays_to_all),
            clearance=self.scene.rays_to_all.clearance,
        ).valid[:, 0]
        if not seen.any():
            return None
        chain = unfolded_chain(self.mirrors, leg.sequence, image.positions, centre[None])
        wave = direct_wave(lengths, frequencies, waves="spherical")
        # The scattering centre receives the component along the field of the antenna's image.
        wave *= reflected_field(
            self.mirrors,
            chain,
            frequencies,
            sent=sight.pattern.polarization,
            at_place=image.pattern.polarization,
        )
        return np.asarray(np.where(seen, gains, 0.0)[:, None] * wave)

    def _answer(
        self,
        chain: DiffuseLeg,
        some: Int[np.ndarray, " some"],
        centre: Float[np.ndarray, " 3"],
        ends: Float[np.ndarray, "2 3"],
        fields: tuple[AntennaPattern, AntennaPattern],
    ) -> "_Answer":
        """Return the target's amplitudes from places on a rough mirror to one end."""
        frequencies = self.scene.scenario.radio.frequencies
        if self.scene.facets is None:
            raise ValueError("the scene has no facets; give a scene with a scattering object")
        spread = self.scene.facets.centres[some]
        size = float(np.linalg.norm(np.ptp(self.facets.centres, axis=0)))
        after = chain.after
        # Image of the rough mirror in the mirrors between it and the target.
        seen_as = partial(_turned_back, after)
        apart = float(np.linalg.norm(seen_as(spread) - centre, axis=-1).min())
        width = np.sort(np.ptp(spread, axis=0))
        side = max(
            FEWEST_PLACES * speed_of_light / float(frequencies[-1]) * apart / size,
            float(np.sqrt(width[-1] * width[-2] / MOST_PLACES)),
        )
        tiles = cut_into_patches(self.scene.facets.part(some), np.arange(len(some)), side)
        amplitudes = self._amplitudes(seen_as(tiles.centres), ends[1], centre, fields)
        specular = self._amplitudes(ends[:1], ends[1], centre, fields)[0]
        level = np.sqrt(np.mean(np.abs(amplitudes) ** 2, axis=0))
        reference = np.exp(1j * np.angle(specular)) * np.maximum(np.abs(specular), level)
        return _Answer(
            tree=KDTree(tiles.centres),
            amplitudes=amplitudes,
            frequencies=frequencies,
            nodes=_nodes(amplitudes, frequencies),
            reference=reference,
        )

    def _amplitudes(
        self,
        places: Float[np.ndarray, "places 3"],
        end: Float[np.ndarray, " 3"],
        centre: Float[np.ndarray, " 3"],
        fields: tuple[AntennaPattern, AntennaPattern],
    ) -> Complex[np.ndarray, "places freqs"]:
        """Sum the target's facets from places to one end, over the links with the centre. [-]."""
        frequencies, facets = self.scene.scenario.radio.frequencies, self.facets
        height = np.einsum("fx,fx->f", end - facets.centres, facets.mean_normals)
        links = Links(
            senders=np.broadcast_to(end, places.shape),
            receivers=places,
            sent=_isotropic(fields[1].polarization),
            received=_isotropic(_as_source(fields[0].polarization)),
        )
        amplitudes: np.ndarray = scattered_by_patches(
            facets,
            links,
            partial(_everything, len(places)),
            frequencies,
            chosen=facets.two_sided | (height > 0),
        )
        for sources in (places, end[None]):
            ways = np.linalg.norm(sources - centre, axis=-1)
            amplitudes = amplitudes / direct_wave(ways, frequencies, waves="spherical")
        return amplitudes


def _as_source(probe: Polarization) -> Polarization:
    """Return the polarization of a source that radiates the field which a probe receives."""
    return Polarization(axis=probe.axis, cross_polar=-probe.cross_polar)


def _isotropic(polarization: Polarization) -> AntennaPattern:
    return AntennaPattern(Isotropic(), np.array([0.0, 1.0, 0.0]), polarization)


def _probe(image: AntennaGroup) -> AntennaPattern:
    """Return an isotropic antenna that receives the field of an antenna's image."""
    return _isotropic(_as_source(image.pattern.polarization))


def _turned_back(leg: Leg, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    return np.asarray(np.einsum("yx,ny->nx", leg.turn, points - leg.shift))


def _everything(count: int, some: Int[np.ndarray, " some"]) -> Seen:
    return Seen(
        always=np.ones(len(some), dtype=bool),
        sometimes=np.empty(0, dtype=np.int64),
        table=np.empty((0, count), dtype=bool),
    )


def _nodes(
    amplitudes: Complex[np.ndarray, "places freqs"], frequencies: Float[np.ndarray, " freqs"]
) -> int:
    """Count the frequencies that suffice to interpolate a target's response over the band."""
    exact = amplitudes[:: 1 + len(amplitudes) // 200]
    norm = float(np.linalg.norm(exact))
    for count in ANSWER_NODES[:-1]:
        nodes = chebyshev_nodes(float(frequencies[0]), float(frequencies[-1]), count)
        basis = barycentric_basis(nodes, frequencies)
        found = np.einsum("pn,nf->pf", _between(exact, frequencies, nodes), basis)
        if float(np.linalg.norm(found - exact)) <= ANSWER_ACCURACY * norm:
            return count
    return ANSWER_NODES[-1]


def _between(
    values: Complex[np.ndarray, "places freqs"],
    frequencies: Float[np.ndarray, " freqs"],
    nodes: Float[np.ndarray, " nodes"],
) -> Complex[np.ndarray, "places nodes"]:
    """Interpolate linearly from the frequency grid."""
    step = frequencies[1] - frequencies[0]
    place = np.clip((nodes - frequencies[0]) / step, 0.0, frequencies.size - 1.0)
    below = np.minimum(place.astype(np.int64), frequencies.size - 2)
    share = place - below
    return np.asarray(values[:, below] * (1 - share) + values[:, below + 1] * share)


@dataclass(frozen=True, kw_only=True)
class _Answer:
    """A target's complex amplitude for waves from places on a mirror, towards one end."""

    tree: KDTree
    amplitudes: Complex[np.ndarray, "places freqs"]
    frequencies: Float[np.ndarray, " freqs"]
    nodes: int
    reference: Complex[np.ndarray, " freqs"]

    def __call__(
        self,
        links: Links,
        centres: Float[np.ndarray, "patches 3"],
        nodes: Float[np.ndarray, " nodes"],
    ) -> Complex[np.ndarray, "patches 1 nodes"]:
        """Return the amplitudes at the places nearest to patches."""
        nearest = self.tree.query(centres)[1]
        return _between(self.amplitudes[nearest], self.frequencies, nodes)[:, None, :]
