r"""Chains of several surfaces in two dimensions: ghosts in the echo, pilots over two walls.

Each chain is cut at one of its surfaces, the target. With the one-way waves :math:`\eta` and
their slopes :math:`\eta'` that both ends send there
(:mod:`simulator.multibounce.iterative_physical_optics`), the target links them by reciprocity,

.. math:: S = \frac{1}{8\pi} \sum_q \Gamma_q\, (\eta_t \eta'_r + \eta'_t \eta_r)\, ds_q

which for a conductor seen by one and the same antenna is
:math:`-2 \sum h\, \partial h/\partial n\, ds`; with spherical waves, times
:math:`\sqrt{\lambda/L}\, e^{j\pi/4}` with the length L of the whole path, so that flat mirrors
give :math:`\lambda/4\pi L`.

What is in it: chains of two and of three surfaces, each chain once for each order in which its
surfaces are met. An echo is cut in the middle (out and back over any walls, or directly one of
the ways), an uplink at its last surface. A single surface is left to plain physical optics.
What is neglected: chains of four and more surfaces, several scatterings within one object,
diffraction around an object beyond what its lit facets radiate, and the near field of facets
closer to each other than a wavelength.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, pairwise, product

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from scipy.constants import speed_of_light

from estimator.compute.engine import thread_count
from estimator.measurement.model import Waves
from simulator.antennas.ports import Ports
from simulator.geometry.faces import Face
from simulator.materials.reflection_table import reflection_table
from simulator.multibounce.frequency_interpolation import (
    EveryFrequency,
    FewFrequencies,
    few_frequencies,
)
from simulator.multibounce.iterative_physical_optics import (
    Bounds,
    Wave,
    direct,
    onward,
    onward_bounds,
    quadrature,
    unit,
)

MOST_BOUNCES = 3
"""Longest chain of surfaces that is summed. [-]"""

WAVE_BYTES = 2**29
"""What the waves at one block of a target's facets may take: 512 MiB. [byte]"""

FACETS_AT_ONCE = 1500
"""Most facets of a target in one block. [-]"""

GAUSS_LIMITS = (0.24, 1.28, 2.6)
"""Half the phase over a facet up to which one, two and three Gauss points are within 1 %. [rad]"""

OUTLINE = 64
"""Points that stand for a surface where only its directions are asked for. [-]"""

Sees = Callable[[Face, Face], Bool[np.ndarray, "one other"]]
"""Tells which facets of two faces see each other."""

SeveralProgress = Callable[[int, int], None]
"""Told how much is done, and of how much. [-]"""


def untold(done: int, total: int) -> None:
    """Tell nobody."""


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A wave from the ports over a wall to a target, not yet worked out."""

    ports: Ports
    wall: Face
    seen: Bool[np.ndarray, "wall target"]
    bounds: Bounds

    def part(self, chosen: slice | Int[np.ndarray, " chosen"]) -> "Passage":
        """Choose some of the target's facets."""
        return replace(self, seen=self.seen[:, chosen], bounds=self.bounds.part(chosen))

    def arriving(self, target: Face, nodes: Float[np.ndarray, " nodes"]) -> Wave:
        """Work the wave out."""
        sent = direct(self.wall, self.ports, nodes)
        return onward(sent, self.wall, target, self.seen, self.bounds, nodes)


def ghost_echo(
    faces: Sequence[Face],
    sees: Sees,
    array: Ports,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    waves: Waves,
    max_bounces: int = 3,
    interpolate: bool = True,
    progress: SeveralProgress = untold,
) -> Complex[np.ndarray, "ports freqs"]:
    """Sum the monostatic echoes over two and three surfaces.

    Parameters
    ----------
    faces
        Sides of the surfaces, after :func:`scattering_faces`.
    sees
        Their mutual visibility.
    array
        The antennas: each transmits, and receives what returns.
    frequencies
        Uniform grid. [Hz]
    waves
        Spherical (S-parameters) or cylindrical (fields of a unit line source).
    max_bounces
        Surfaces in a chain; below two there is nothing to sum.
    interpolate
        Work the waves out at few frequencies and interpolate; otherwise at every frequency.
    progress
        Told how many facets that chains are cut at are done.

    Returns
    -------
    S-parameter at each port; with cylindrical waves, field per unit line source. [-]
    """
    echo = np.zeros((len(array.positions), frequencies.size), dtype=np.complex128)
    if max_bounces < 2:
        return echo
    seen_directly = [bool(array.visible[:, face.source].any()) for face in faces]
    cuts: list[tuple[Face, list[tuple[bool, Passage]]]] = []
    for place, target in enumerate(faces):
        passages: list[tuple[bool, Passage]] = []
        for origin, wall in enumerate(faces):
            # Two surfaces: met in either order, worked out once, at the later of them.
            both = origin < place and seen_directly[place]
            if wall.surface == target.surface or not seen_directly[origin]:
                continue
            if both or max_bounces > 2:
                found = _passage(array, wall, target, sees, float(frequencies[-1]))
                passages += [] if found is None else [(both, found)]
        if passages:
            met = np.flatnonzero(np.any([one.seen.any(axis=0) for _, one in passages], axis=0))
            cuts.append((target.part(met), [(both, one.part(met)) for both, one in passages]))
    done, facets = 0, sum(target.count for target, _ in cuts)
    for target, passages in cuts:
        for count, part in _echo_of(
            target,
            passages,
            array,
            frequencies,
            waves=waves,
            thrice=max_bounces > 2,
            interpolate=interpolate,
        ):
            echo += part
            done += count
            progress(done, facets)
    return echo


def uplink_over_surfaces(
    faces: Sequence[Face],
    sees: Sees,
    user: Ports,
    array: Ports,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    waves: Waves,
    max_bounces: int = 3,
    interpolate: bool = True,
    progress: SeveralProgress = untold,
) -> Complex[np.ndarray, "ports freqs"]:
    """Sum what reaches each element from one user over two and three surfaces.

    Parameters
    ----------
    faces, sees
        As for :func:`ghost_echo`.
    user
        The transmitting port, a single one.
    array
        The elements.
    frequencies, waves, max_bounces, interpolate
        As for :func:`ghost_echo`.
    progress
        Told how many chains are done.

    Returns
    -------
    S-parameter at each element; with cylindrical waves, field per unit line source. [-]
    """
    pilot = np.zeros((len(array.positions), frequencies.size), dtype=np.complex128)
    chains = [
        chain
        for bounces in range(2, min(max_bounces, MOST_BOUNCES) + 1)
        for chain in product(faces, repeat=bounces)
        if all(one.surface != next_.surface for one, next_ in pairwise(chain))
    ]
    for done, chain in enumerate(chains, start=1):
        pilot += _pilot_over(chain, sees, user, array, frequencies, waves, interpolate)
        progress(done, len(chains))
    return pilot


def _passage(ports: Ports, wall: Face, target: Face, sees: Sees, highest: float) -> Passage | None:
    """Prepare the way over a wall, from the facets that the ports see; None if there is none."""
    lit = np.flatnonzero(ports.visible[:, wall.source].any(axis=0))
    wall, seen = _towards(wall.part(lit), target, ports.positions[:, :2], sees, highest)
    if wall.count == 0:
        return None
    bounds = onward_bounds(direct(wall, ports, np.ones(1)).bounds, wall, target, seen)
    if not bounds.longest.any():
        return None
    return Passage(ports=ports, wall=wall, seen=seen, bounds=bounds)


def _towards(
    wall: Face,
    target: Face,
    before: Float[np.ndarray, "points 2"],
    sees: Sees,
    highest: float,
) -> tuple[Face, Bool[np.ndarray, "wall target"]]:
    """Choose the facets of a wall that see a target, with the points that their phase needs.

    The phase over a facet turns with the directions of the wave from ``before`` and of what
    goes to the target.
    """
    seen = sees(wall, target)
    kept = np.flatnonzero(seen.any(axis=1))
    wall, seen = wall.part(kept), seen[kept]
    if wall.count == 0:
        return wall, seen
    low, high = np.zeros(wall.count), np.zeros(wall.count)
    for points in (before, target.centres):
        apart = points[:: max(1, len(points) // OUTLINE), None] - wall.centres
        along = np.einsum("pfx,fx->pf", apart, wall.edges) / np.linalg.norm(apart, axis=-1)
        low, high = low + along.min(axis=0), high + along.max(axis=0)
    phase = np.pi * highest / speed_of_light * float(np.maximum(-low, high).max())
    count = 1 + sum(phase > limit for limit in GAUSS_LIMITS)
    return quadrature(wall, count), np.repeat(seen, count, axis=0)


def _echo_of(
    target: Face,
    passages: Sequence[tuple[bool, Passage]],
    array: Ports,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    waves: Waves,
    thrice: bool,
    interpolate: bool,
) -> Iterator[tuple[int, Complex[np.ndarray, "ports freqs"]]]:
    """Sum the chains that are cut at one target, for some of its facets at a time."""
    spread = (1 + thrice) * max(one.bounds.spread for _, one in passages)
    materials = [target.material] + (1 + thrice) * [one.wall.material for _, one in passages]
    total = few_frequencies(frequencies, spread, materials, 2 * array.nodes, interpolate)
    row_bytes = 16 * total.nodes.size * len(array.positions) * len(passages)
    step = max(1, min(FACETS_AT_ONCE, WAVE_BYTES // row_bytes))
    for first in range(0, target.count, step):
        block = slice(first, min(first + step, target.count))
        here = target.part(block)
        sent = direct(here, array, total.nodes)
        arriving = [one.part(block).arriving(here, total.nodes) for _, one in passages]
        # Two ways to run through each chain that is not its own reverse.
        links = [
            (2.0, sent, wave) for (both, _), wave in zip(passages, arriving, strict=True) if both
        ]
        if thrice:
            pairs = combinations_with_replacement(range(len(arriving)), 2)
            links += [(1.0 + (i != j), arriving[i], arriving[j]) for i, j in pairs]
        yield here.count, _linked(here, links, len(array.positions), total, waves)


def _pilot_over(
    chain: Sequence[Face],
    sees: Sees,
    user: Ports,
    array: Ports,
    frequencies: Float[np.ndarray, " freqs"],
    waves: Waves,
    interpolate: bool,
) -> Complex[np.ndarray, "ports freqs"]:
    """Take the user's wave over all surfaces of a chain to the array."""
    pilot = np.zeros((len(array.positions), frequencies.size), dtype=np.complex128)
    target = chain[-1]
    target = target.part(np.flatnonzero(array.visible[:, target.source].any(axis=0)))
    first = chain[0]
    if target.count == 0 or not user.visible[:, first.source].any():
        return pilot
    legs: list[tuple[Face, Bool[np.ndarray, "wall target"]]] = []
    for index in reversed(range(len(chain) - 1)):  # from the array: each wall's points depend
        before = chain[index - 1].centres if index else user.positions[:, :2]  # on what follows
        onto = legs[0][0] if legs else target
        legs.insert(0, _towards(chain[index], onto, before, sees, float(frequencies[-1])))
        if legs[0][0].count == 0:
            return pilot
    faces = [wall for wall, _ in legs] + [target]
    bounds = [direct(faces[0], user, np.ones(1)).bounds]
    for (wall, seen), onto in zip(legs, faces[1:], strict=True):
        bounds.append(onward_bounds(bounds[-1], wall, onto, seen))
    if not bounds[-1].longest.any():
        return pilot
    materials = [face.material for face in chain]
    extra = user.nodes + array.nodes
    total = few_frequencies(frequencies, bounds[-1].spread, materials, extra, interpolate)
    wave = direct(faces[0], user, total.nodes)
    for (wall, seen), onto, limits in zip(legs, faces[1:], bounds[1:], strict=True):
        wave = onward(wave, wall, onto, seen, limits, total.nodes)
    heard = direct(target, array, total.nodes)
    return _linked(target, [(1.0, wave, heard)], len(array.positions), total, waves)


def _linked(
    target: Face,
    links: Sequence[tuple[float, Wave, Wave]],
    ports: int,
    total: FewFrequencies | EveryFrequency,
    waves: Waves,
) -> Complex[np.ndarray, "ports freqs"]:
    """Link pairs of waves at a target, by reciprocity; the factors say how often each counts."""
    nodes, frequencies = total.nodes, total.frequencies
    table = reflection_table(target.material, nodes)

    def of_port(port: int) -> Complex[np.ndarray, " freqs"]:
        delays, amplitudes = [], []
        for factor, one, other in links:
            sent, received = one.part(slice(None), port), other.part(slice(None), port)
            lit = (sent.bounds.longest > 0) & (received.bounds.longest > 0)
            some = np.flatnonzero(lit[0])
            sent, received, face = one.part(some, port), other.part(some, port), target.part(some)
            ends = sent.bounds.origins, received.bounds.origins
            towards = unit(ends[0] - face.centres) + unit(ends[1] - face.centres)
            advance = np.einsum("pfx,fx->pf", towards, face.edges) / speed_of_light
            cosines = np.minimum(np.hypot(towards[..., 0], towards[..., 1]) / 2, 1.0)
            weight = face.sizes * np.sinc(nodes[:, None, None] * advance)
            weight = weight * (factor / (8 * np.pi))
            weight = weight * table.at(table.places(cosines), slice(None))
            if waves == "spherical":
                lengths = sent.bounds.shortest + received.bounds.shortest
                weight = weight / np.sqrt(lengths)
            amplitude = sent.strength * received.slope + sent.slope * received.strength
            amplitudes.append((amplitude * weight)[:, 0].astype(np.complex128))
            delays.append(((sent.middle + received.middle) / speed_of_light)[0])
        return total(np.concatenate(delays), np.concatenate(amplitudes, axis=1))

    if not links:
        return np.zeros((ports, frequencies.size), dtype=np.complex128)
    with ThreadPoolExecutor(thread_count()) as pool:
        sums = np.stack(list(pool.map(of_port, range(ports))))
    if waves == "spherical":
        sums *= np.exp(0.25j * np.pi) * np.sqrt(speed_of_light / frequencies)
    return sums
