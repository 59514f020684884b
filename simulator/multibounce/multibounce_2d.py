r"""Chains of several surfaces in two dimensions: ghosts in the echo, pilots over two walls.

Each chain is divided at one of its surfaces, the target. With the one-way waves :math:`\eta` of
both ends there and their slopes :math:`\eta'`
(:mod:`simulator.multibounce.iterative_physical_optics`), the target links them by reciprocity,

.. math:: S = \frac{1}{8\pi} \sum_q \Gamma_q\, (\eta_t \eta'_r + \eta'_t \eta_r)\, ds_q

which for a conductor seen by one and the same antenna is
:math:`-2 \sum h\, \partial h/\partial n\, ds`; with spherical waves, times
:math:`\sqrt{\lambda/L}\, e^{j\pi/4}` with the length L of the whole path, so that flat mirrors
give :math:`\lambda/4\pi L`.

Included are chains of two and more surfaces, up to ``max_bounces``, once for each order of their
surfaces. An echo is divided in the middle (each leg over any walls or direct), an uplink at its
last surface. A single surface is left to plain physical optics. Chains are enumerated and their
work is counted in :mod:`simulator.multibounce.chain_count`.
Left out are multiple scattering within one object, diffraction around an object beyond the
radiation of its illuminated facets, and the near field of facets less than a wavelength apart.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations_with_replacement

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.compute.engine import thread_count
from estimator.measurement.model import Waves
from simulator.antennas.ports import Ports
from simulator.geometry.faces import Face
from simulator.materials.fresnel_slab import Dielectric, Material
from simulator.materials.reflection_table import reflection_table
from simulator.multibounce.chain_count import Sees, chains_to
from simulator.multibounce.frequency_interpolation import (
    EveryFrequency,
    FewFrequencies,
    few_frequencies,
)
from simulator.multibounce.iterative_physical_optics import (
    Wave,
    direct,
)
from simulator.multibounce.passage import Link, Passage, passages_over
from simulator.multibounce.rough_faces import rough_factor, unit

WAVE_BYTES = 2**29
"""Most memory of the waves at a block of a target's facets, and of those at the walls before it:
512 MiB each. [byte]"""

FACETS_AT_ONCE = 1500
"""Most facets of a target in one block. [-]"""

FEWEST_PORTS = 8
"""Ports in one block, if memory allows: what a link costs by itself is shared among them. [-]"""

SeveralProgress = Callable[[int, int], None]
"""Called with the work done and the work in all. [-]"""


def untold(done: int, total: int) -> None:
    """Report no progress."""


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
    """Sum the monostatic echoes over two and more surfaces.

    Parameters
    ----------
    faces
        Sides of the surfaces, after :func:`scattering_faces`.
    sees
        Their mutual visibility.
    array
        The antennas: each transmits, and receives its own echo.
    frequencies
        Uniform grid. [Hz]
    waves
        Spherical (S-parameters) or cylindrical (fields of a unit line source).
    max_bounces
        Most surfaces in a chain; below two the sum is empty.
    interpolate
        Whether waves are computed at few frequencies and interpolated, not at every one.
    progress
        Called with the number of target facets done, counted for each port.

    Returns
    -------
    S-parameter at each port; with cylindrical waves, field per unit line source. [-]
    """
    echo = np.zeros((len(array.positions), frequencies.size), dtype=np.complex128)
    if max_bounces < 2:
        return echo
    ways = array.ways
    seen_directly = [any(w.visible[:, face.source].any() for w in ways) for face in faces]
    cuts: list[tuple[Face, list[Link]]] = []
    for place, target in enumerate(faces):
        passages = [
            (chain, found)
            for chain in chains_to(place, faces, sees, seen_directly, max_bounces // 2)
            for ports in ways
            for found in passages_over(
                ports, [faces[one] for one in chain], target, sees, frequencies
            )
        ]
        directly = [w for w in ways if w.visible[:, target.source].any()]
        links = _echo_links(passages, place, max_bounces, directly)
        if links:
            used = _passages_of(links)
            met = np.flatnonzero(
                np.any([one.sights[-1].seen.any(axis=0) for one in used.values()], axis=0)
            )
            parts: dict[int, Passage] = {key: one.part(met) for key, one in used.items()}
            links = [
                Link(link.factor, parts[id(link.out)], parts.get(id(link.back), link.back))
                for link in links
            ]
            cuts.append((target.part(met), links))
    done, steps = 0, len(array.positions) * sum(target.count for target, _ in cuts)
    for target, links in cuts:
        for rows, count, part in _echo_of(
            target, links, array, frequencies, waves=waves, interpolate=interpolate
        ):
            echo[rows] += part
            done += count * len(part)
            progress(done, steps)
    return echo


def _passages_of(links: Sequence[Link]) -> dict[int, Passage]:
    """Return the passages of links, each once, by their identity."""
    ends = (one for link in links for one in (link.out, link.back))
    return {id(one): one for one in ends if isinstance(one, Passage)}


def _echo_links(
    passages: Sequence[tuple[tuple[int, ...], Passage]],
    place: int,
    max_bounces: int,
    directly: Sequence[Ports],
) -> list[Link]:
    """Pair the passages to a target: each chain of surfaces once, together with its reverse.

    A chain of an odd number of surfaces is divided at its middle one, with as many walls on either
    side. One of an even number differs from its reverse; of the two, that one is divided whose two
    middle surfaces are in ascending order, at the later of them.
    """
    links = []
    for (i, (out, to)), (j, (back, fro)) in combinations_with_replacement(enumerate(passages), 2):
        if len(out) == len(back) and 2 * len(out) + 1 <= max_bounces:
            links.append(Link(1.0 + (i != j), to, fro))
        for longer, shorter, one, other in ((out, back, to, fro), (back, out, fro, to)):
            even = len(longer) == len(shorter) + 1 and 2 * len(longer) <= max_bounces
            if even and longer[-1] < place:
                links.append(Link(2.0, one, other))
    if max_bounces >= 2:
        links += [
            Link(2.0, one, ports)
            for chain, one in passages
            if len(chain) == 1 and chain[0] < place
            for ports in directly
        ]
    return links


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
    """Sum the pilot of one user at each element over two and more surfaces.

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
        Called with the number of chains done.

    Returns
    -------
    S-parameter at each element; with cylindrical waves, field per unit line source. [-]
    """
    pilot = np.zeros((len(array.positions), frequencies.size), dtype=np.complex128)
    seen_directly = [any(w.visible[:, face.source].any() for w in user.ways) for face in faces]
    chains = [
        (*chain, place)
        for place, last in enumerate(faces)
        if any(w.visible[:, last.source].any() for w in array.ways)
        for chain in chains_to(place, faces, sees, seen_directly, max_bounces - 1)
    ]
    for done, chain in enumerate(sorted(chains, key=lambda one: (len(one), one)), start=1):
        met = [faces[one] for one in chain]
        for sender in user.ways:
            for receiver in array.ways:
                pilot += _pilot_over(met, sees, sender, receiver, frequencies, waves, interpolate)
        progress(done, len(chains))
    return pilot


def _echo_of(
    target: Face,
    links: Sequence[Link],
    array: Ports,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    waves: Waves,
    interpolate: bool,
) -> Iterator[tuple[slice, int, Complex[np.ndarray, "ports freqs"]]]:
    """Yield partial sums of the chains divided at one target, for some ports and facets each.

    Each item holds the ports, the number of facets, and their sum.
    """
    total = _few_frequencies(target, links, frequencies, interpolate)
    passages = _passages_of(links)
    ports_of = {id(link.back): link.back for link in links if isinstance(link.back, Ports)}
    # Waves at walls after the first vary with frequency, and so do those that came through slabs;
    # others at the first take little memory.
    held = sum(
        one.walls[-1].count
        for one in passages.values()
        if len(one.walls) > 1 or one.ports.nodes > 1
    )
    ports, at_once = len(array.positions), max(1, WAVE_BYTES // (16 * total.nodes.size))
    # Each block of facets takes the walls' waves anew: few ports at many facets, not the reverse.
    wanted = len(passages) * min(target.count, FACETS_AT_ONCE)
    together = min(max(FEWEST_PORTS, at_once // max(1, wanted)), max(1, at_once // max(1, held)))
    for row in range(0, ports, together):
        rows = slice(row, min(row + together, ports))
        antennas = {key: one.part(rows) for key, one in ports_of.items()}
        some = {key: one.of_ports(rows) for key, one in passages.items()}
        sent = {key: one.at_last_wall(total.nodes) for key, one in some.items()}
        width = (rows.stop - rows.start) * len(passages)
        step = max(1, min(FACETS_AT_ONCE, at_once // width))
        for first in range(0, target.count, step):
            block = slice(first, min(first + step, target.count))
            here = target.part(block)
            arriving = {
                key: one.part(block).arriving(sent[key], here, total.nodes)
                for key, one in some.items()
            }
            arriving |= {key: direct(here, one, total.nodes) for key, one in antennas.items()}
            pairs = [
                (link.factor, arriving[id(link.out)], arriving[id(link.back)]) for link in links
            ]
            linked = _linked(here, pairs, rows.stop - rows.start, total, waves)
            yield rows, here.count, linked


def _few_frequencies(
    target: Face,
    links: Sequence[Link],
    frequencies: Float[np.ndarray, " freqs"],
    interpolate: bool,
) -> FewFrequencies | EveryFrequency:
    """Choose the frequencies that suffice for all chains divided at one target."""
    extra = max(link.nodes for link in links)
    spreads: dict[tuple[int, ...], float] = {}
    met: dict[tuple[int, ...], tuple[list[Material], list[Dielectric]]] = {}
    for link in links:
        made = [target.material, *(wall.material for wall in link.walls)]
        crossed = [crossing.material for crossing in link.slabs]
        key = (*sorted(map(id, made)), 0, *sorted(map(id, crossed)))
        spreads[key] = max(spreads.get(key, 0.0), link.spread)
        met[key] = made, crossed
    choices = [
        few_frequencies(frequencies, spread, *met[key], extra, interpolate)
        for key, spread in spreads.items()
    ]
    return max(choices, key=lambda choice: choice.nodes.size)


def _pilot_over(
    chain: Sequence[Face],
    sees: Sees,
    user: Ports,
    array: Ports,
    frequencies: Float[np.ndarray, " freqs"],
    waves: Waves,
    interpolate: bool,
) -> Complex[np.ndarray, "ports freqs"]:
    """Propagate the user's wave over all surfaces of a chain to the array."""
    pilot = np.zeros((len(array.positions), frequencies.size), dtype=np.complex128)
    target = chain[-1]
    target = target.part(np.flatnonzero(array.visible[:, target.source].any(axis=0)))
    if target.count == 0:
        return pilot
    materials = [face.material for face in chain]
    for passage in passages_over(user, chain[:-1], target, sees, frequencies):
        extra = passage.nodes + array.nodes - array.slab_nodes
        slabs = [crossing.material for crossing in (*passage.slabs, *array.slabs)]
        total = few_frequencies(frequencies, passage.spread, materials, slabs, extra, interpolate)
        wave = passage.arriving(passage.at_last_wall(total.nodes), target, total.nodes)
        heard = direct(target, array, total.nodes)
        pilot += _linked(target, [(1.0, wave, heard)], len(array.positions), total, waves)
    return pilot


def _linked(
    target: Face,
    links: Sequence[tuple[float, Wave, Wave]],
    ports: int,
    total: FewFrequencies | EveryFrequency,
    waves: Waves,
) -> Complex[np.ndarray, "ports freqs"]:
    """Link pairs of waves at a target by reciprocity, each with the weight of its chain."""
    nodes, frequencies = total.nodes, total.frequencies
    table = reflection_table(target.material, nodes, polarization=target.polarization)

    def of_port(port: int) -> Complex[np.ndarray, " freqs"]:
        delays, amplitudes = [], []
        for factor, one, other in links:
            sent, received = one.part(slice(None), port), other.part(slice(None), port)
            lit = (sent.bounds.longest > 0) & (received.bounds.longest > 0)
            some = np.flatnonzero(lit[0])
            sent, received, face = one.part(some, port), other.part(some, port), target.part(some)
            ends = sent.bounds.origins, received.bounds.origins
            ways = unit(ends[0] - face.centres), unit(ends[1] - face.centres)
            towards = ways[0] + ways[1]
            advance = np.einsum("pfx,fx->pf", towards, face.edges) / speed_of_light
            cosines = np.minimum(np.hypot(towards[..., 0], towards[..., 1]) / 2, 1.0)
            weight = face.sizes * np.sinc(nodes[:, None, None] * advance)
            weight = weight * (factor / (8 * np.pi))
            weight = weight * table.at(table.places(cosines), slice(None))
            if face.rough.any():
                weight = weight * rough_factor(face, *ways, float(nodes[nodes.size // 2]))
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
