r"""Waves over several flat faces in space: geometrical optics up to one, physical optics there.

A face cuts out of the wave that the others mirror to it what its outline leaves, and scatters that
by physical optics (E. F. Knott, "RCS reduction of dihedral corners", IEEE Trans. Antennas Propag.
25 (1977) 406). With an antenna's image over the faces before, and the other antenna's over those
after, this is one flat opening between two points, and what comes through it
:func:`simulator.specular.rim_diffraction.rim_factor` times the wave of endless mirrors. So finite
corners, those that are not quite square, and plates that reflect nobody's way come out with level
and phase, and everything is continuous where a reflection enters or leaves a face.

The face that physical optics is left to is that with the fewest Fresnel zones: it is the one whose
outline matters. The others cut sharply, as seen from the antennas' images.

What else stands in the way, and which slabs are crossed, is asked of one ray: that over the place
of the face nearest to where the mirrored way meets its plane. The same place gives the antennas'
gains and the polarization.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from simulator.antennas.beam_culling import AntennaGroup
from simulator.geometry.mirrors import Mirrors
from simulator.geometry.polygon_clipping import empty
from simulator.geometry.ray_scene import blocked
from simulator.materials.slab_insertion import LEAST_LEVEL, passage_level
from simulator.multibounce.views_over_mirrors import (
    image_over,
    nearest_places,
    reflected_by,
    seen_over,
)
from simulator.scene.radio_scene import RadioScene
from simulator.specular.free_space import direct_wave
from simulator.specular.image_method import (
    ON_PLANE,
    ROUGHNESS_CLEARANCE,
    Chain,
    folded_back,
    trace_chain,
)
from simulator.specular.many_sequences import leading_sequences
from simulator.specular.path_field import Through, reflected_field
from simulator.specular.rim_diffraction import rim_factor

FAINT = 1e-3
"""Level, over that of the strongest chain, below which a chain is left out: -60 dB. [-]"""

DOUBT = 3.0
"""By how much a chain may be stronger anywhere than at the array's corners and middle, at three
frequencies: 10 dB, as between the side lobes of a plate and their mean. [-]"""

CLEARLY = 0.9
"""Fresnel zones of a face over those of another one, at most, for it to be taken: between like
faces the last of the way is. [-]"""

MOST_NEAR = 2_000
"""Chains, at most, of which those are looked at, too, that mirror nobody to anybody: some 10 ms
each. Of more, only those that rays follow. [-]"""

NUDGE = np.array([2e-5, 1.4e-5, 0.9e-5])
"""How far a receiver is moved either way to see whether its path meets an edge: farther than
rays are lifted off their mirrors, and along no edge of a usual room. [m]"""

LINKS_AT_ONCE = 128
"""Links that are worked out in one go: some 50 MB with thousands of pieces of rims. [-]"""


def over_flat_faces(
    scene: RadioScene,
    sequences: Iterable[tuple[int, ...]],
    send: AntennaGroup,
    receive: AntennaGroup,
) -> Complex[np.ndarray, "links freqs"]:
    """Sum what chains of flat faces carry from one or several antennas to each of the others.

    Parameters
    ----------
    scene
        The frozen scene; its faces reflect as their mean planes, with the coherent loss of
        their roughness.
    sequences
        Faces from the sending antennas onward.
    send, receive
        Pairwise; a single sender serves all receivers.

    Returns
    -------
    S-parameter of each link. What stays below :data:`FAINT` of the strongest is left out. [-]
    """
    frequencies = scene.scenario.radio.frequencies
    total = np.zeros((len(receive.positions), frequencies.size), dtype=np.complex128)
    if scene.mirrors is None:
        return total
    # Where a chain's level is looked at before it is worked out.
    few = np.linspace(frequencies[0], frequencies[-1], 3)
    outer = _outer(receive)
    pairs = _Pairs(scene, scene.mirrors.mirrors, send, receive)
    candidates = []
    possible = _facing(scene.mirrors.mirrors, list(sequences))
    if len(possible) > MOST_NEAR:
        senders, receivers = pairs.ends(outer)
        possible = leading_sequences(
            scene.mirrors.mirrors,
            possible,
            np.concatenate([senders, senders]),
            np.concatenate([receivers + NUDGE, receivers - NUDGE]),
        )
        possible = [one for one in possible if pairs.mirrored(one, outer)]
    for sequence in possible:
        place = pairs.place(sequence)
        if place is None:
            continue
        level = float(np.abs(pairs.wave(sequence, place, outer, few)).max(initial=0.0))
        if level > 0.0:
            candidates.append((sequence, place, level))
    strongest = max((level for *_, level in candidates), default=0.0)
    everything = np.arange(len(receive.positions))
    for sequence, place, level in candidates:
        if level * DOUBT < FAINT * strongest:
            continue
        for first in range(0, everything.size, LINKS_AT_ONCE):
            some = everything[first : first + LINKS_AT_ONCE]
            total[some] += pairs.wave(sequence, place, some, frequencies)
    return total


def _facing(mirrors: Mirrors, sequences: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Keep the sequences of which each mirror has parts on the reflecting side of the next.

    Pairs are tested as they occur: a town has ten thousand mirrors, and few of them in sequence.
    """
    pairs = {(min(pair), max(pair)) for one in sequences for pair in pairwise(one)}
    if not pairs:
        return sequences
    first, second = np.array(sorted(pairs)).T
    facing = _before(mirrors, first, second) & _before(mirrors, second, first)
    good = set(zip(first[facing].tolist(), second[facing].tolist(), strict=True))
    return [one for one in sequences if all((min(p), max(p)) in good for p in pairwise(one))]


def _before(
    mirrors: Mirrors, some: Int[np.ndarray, " pairs"], others: Int[np.ndarray, " pairs"]
) -> Bool[np.ndarray, " pairs"]:
    """Tell of which mirrors the others have parts on the reflecting side."""
    from_plane = mirrors.corners[others] - mirrors.corners[some, :1]
    heights = np.einsum("pcx,px->pc", from_plane, mirrors.normals[some])
    heights = np.where(mirrors.two_sided[some, None], np.abs(heights), heights)
    return np.asarray(heights.max(axis=1) > ON_PLANE)


def _outer(group: AntennaGroup) -> Int[np.ndarray, " some"]:
    """Choose the antennas nearest to the corners and the middle of their box."""
    apart = group.positions[:, None] - group.outline
    return np.unique(np.einsum("nox,nox->no", apart, apart).argmin(axis=0))


@dataclass(frozen=True)
class _Pairs:
    """Links, and the faces between them."""

    scene: RadioScene
    mirrors: Mirrors
    send: AntennaGroup
    receive: AntennaGroup

    def ends(
        self, some: Int[np.ndarray, " some"]
    ) -> tuple[Float[np.ndarray, "some 3"], Float[np.ndarray, "some 3"]]:
        """Return where some links begin and end [m]."""
        senders = self.send.positions
        if len(senders) == 1:
            return np.repeat(senders, len(some), axis=0), self.receive.positions[some]
        return senders[some], self.receive.positions[some]

    def mirrored(self, sequence: tuple[int, ...], some: Int[np.ndarray, " some"]) -> bool:
        """Tell whether any of some links has a specular path, or one over an edge."""
        senders, receivers = self.ends(some)
        return any(
            trace_chain(
                self.mirrors,
                sequence,
                senders,
                receivers + side * NUDGE,
                blocked=partial(blocked, self.scene.rays),
                clearance=self.scene.rays.clearance,
                paired=True,
            ).valid.any()
            for side in (1.0, -1.0)
        )

    def place(self, sequence: tuple[int, ...]) -> int | None:
        """Choose the face with the fewest Fresnel zones; none if the chain cannot be."""
        mirrors = self.mirrors
        sender, receiver = self.send.centre[None], self.receive.centre[None]
        chosen, fewest = None, np.inf
        for place in reversed(range(len(sequence))):
            face = sequence[place]
            source = image_over(mirrors, sequence[:place], sender)
            other = image_over(mirrors, sequence[:place:-1], receiver)
            corners = mirrors.corners[face]
            ways = [corners.mean(axis=0) - end[0] for end in (source, other)]
            near = [max(float(np.linalg.norm(way)), 1e-9) for way in ways]
            across = np.cross(corners[2] - corners[0], corners[3] - corners[1]) / 2
            facing = max(
                abs(float(across @ way)) / far for way, far in zip(ways, near, strict=True)
            )
            zones = facing * (1 / near[0] + 1 / near[1])
            if zones < CLEARLY * fewest:
                chosen, fewest = place, zones
        return chosen

    def wave(
        self,
        sequence: tuple[int, ...],
        place: int,
        some: Int[np.ndarray, " some"],
        frequencies: Float[np.ndarray, " freqs"],
    ) -> Complex[np.ndarray, "some freqs"]:
        """Work out one chain with physical optics on one of its faces."""
        found = np.zeros((len(some), frequencies.size), dtype=np.complex128)
        mirrors, face = self.mirrors, sequence[place]
        out, back = sequence[:place], sequence[:place:-1]
        senders, receivers = self.ends(some)
        lit = reflected_by(mirrors, out, senders) & reflected_by(mirrors, back, receivers)
        source, other = image_over(mirrors, out, senders), image_over(mirrors, back, receivers)
        sides = mirrors.heights(source, face), mirrors.heights(other, face)
        lit &= (sides[0] * sides[1] > 0) & (np.minimum(*np.abs(sides)) > ON_PLANE)
        if not mirrors.two_sided[face]:
            lit &= sides[0] > 0
        lit = np.flatnonzero(lit)
        if not lit.size:
            return found
        left = np.repeat(mirrors.corners[face][None], lit.size, axis=0)
        for leg, eye in ((out, source[lit]), (back, other[lit])):
            left = seen_over(mirrors, leg, eye, left, mirrors.normals[face])
        whole = ~empty(left)
        lit, left = lit[whole], left[whole]
        if not lit.size:
            return found
        image = mirrors.images(source[lit], face)
        meets = nearest_places(image, other[lit], left, mirrors.normals[face])
        ways = self._ways(sequence, place, (senders[lit], receivers[lit]), meets, sides[0][lit])
        lit, left, image, meets = (values[ways.clear] for values in (lit, left, image, meets))
        if not lit.size:
            return found
        chain = _bent_chain(mirrors, sequence, place, (source[lit], other[lit]), meets)
        straight = other[lit] - image
        lengths = np.sqrt(np.einsum("lx,lx->l", straight, straight))
        gains = self.send.pattern.towards(chain.departures)
        gains = gains * self.receive.pattern.towards(chain.arrivals)
        wave = direct_wave(lengths, frequencies, waves="spherical") * gains[:, None]
        wave *= rim_factor(image, other[lit], left, frequencies)
        for alike, through in ways.by_slabs(self.scene):
            part = _part(chain, alike)
            field = reflected_field(
                mirrors,
                part,
                frequencies,
                sent=self.send.pattern.polarization,
                received=self.receive.pattern.polarization,
                through=through,
            )
            found[lit[alike]] = wave[alike] * field
        return found

    def _ways(
        self,
        sequence: tuple[int, ...],
        place: int,
        ends: tuple[Float[np.ndarray, "some 3"], Float[np.ndarray, "some 3"]],
        meets: Float[np.ndarray, "some 3"],
        sides: Float[np.ndarray, " some"],
    ) -> "_Ways":
        """Send a ray over both legs to the face."""
        rays, mirrors, face = self.scene.rays, self.mirrors, sequence[place]
        lift = rays.clearance + ROUGHNESS_CLEARANCE * mirrors.rms_heights[face]
        offsets = lift * np.sign(sides)[:, None] * mirrors.normals[face]
        clear = np.ones(len(meets), dtype=bool)
        crossed = np.zeros((len(meets), len(sequence) + 1), dtype=np.int64)
        for leg, end, backward in (
            (sequence[:place], ends[0], False),
            (sequence[:place:-1], ends[1], True),
        ):
            chain = trace_chain(
                mirrors,
                leg,
                end,
                meets,
                blocked=partial(blocked, rays),
                clearance=rays.clearance,
                receiver_offsets=offsets,
                paired=True,
                slabs=self.scene.slabs,
            )
            valid = np.diagonal(chain.valid)
            clear &= valid
            if chain.crossed is not None:
                count = len(leg) + 1
                if backward:
                    crossed[valid, place + 1 :] = chain.crossed[:, ::-1][:, :count]
                else:
                    crossed[valid, :count] = chain.crossed
        kept = np.flatnonzero(clear)
        return _Ways(kept, crossed[kept])


@dataclass(frozen=True)
class _Ways:
    """Links whose rays nothing blocks, and the sets of slabs on each part of the way."""

    clear: Int[np.ndarray, " clear"]
    crossed: Int[np.ndarray, "clear parts"]

    def by_slabs(self, scene: RadioScene) -> Iterator[tuple[Int[np.ndarray, " alike"], Through]]:
        """Take links over the same slabs together; those that let next to nothing through go."""
        frequencies = scene.scenario.radio.frequencies
        kinds, kind = np.unique(self.crossed, axis=0, return_inverse=True)
        for index, sets in enumerate(kinds.tolist()):
            through = tuple(scene.slabs.crossings(one) for one in sets)
            slabs = [one for part in through for one in part]
            if not slabs:
                through = ()
            elif passage_level(slabs, frequencies) < LEAST_LEVEL:
                continue
            yield np.flatnonzero(kind.ravel() == index), through


def _bent_chain(
    mirrors: Mirrors,
    sequence: tuple[int, ...],
    place: int,
    images: tuple[Float[np.ndarray, "links 3"], Float[np.ndarray, "links 3"]],
    meets: Float[np.ndarray, "links 3"],
) -> Chain:
    """Lay paths from antennas' images on either side over a place of the face between."""
    parts = []
    for leg, image in zip((sequence[:place], sequence[:place:-1]), images, strict=True):
        way = meets - image
        length = np.sqrt(np.einsum("lx,lx->l", way, way))
        parts.append((length, *folded_back(mirrors, leg, way / length[:, None])))
    (first, out, cosines), (second, back, others) = parts
    inward, outward = out[:, -1], -back[:, -1]
    between = 0.5 * np.linalg.norm(outward - inward, axis=-1)
    return Chain(
        mirrors=sequence,
        valid=np.eye(len(meets), dtype=bool),
        lengths=first + second,
        vertices=np.full((len(meets), len(sequence), 3), np.nan),
        cosines=np.concatenate([cosines, between[:, None], others[:, ::-1]], axis=1),
        directions=np.concatenate([out, -back[:, ::-1]], axis=1),
        bent_at=place,
    )


def _part(chain: Chain, some: Int[np.ndarray, " some"]) -> Chain:
    return Chain(
        mirrors=chain.mirrors,
        valid=np.eye(len(some), dtype=bool),
        lengths=chain.lengths[some],
        vertices=chain.vertices[some],
        cosines=chain.cosines[some],
        directions=chain.directions[some],
        bent_at=chain.bent_at,
    )
