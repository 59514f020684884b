"""A wave's way from its ports over several walls to a target, and which facets of each matter.

A :class:`Passage` is prepared once for all frequencies: the walls' facets that see what
follows, with the points that the phase over them needs, and bounds of all lengths. A
:class:`Link` joins two of them at a target (:mod:`simulator.multibounce.multibounce_2d`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from scipy.constants import speed_of_light

from simulator.antennas.ports import Ports
from simulator.geometry.faces import Face
from simulator.materials.slab_insertion import passage_nodes
from simulator.multibounce.chain_count import Sees, outline
from simulator.multibounce.iterative_physical_optics import (
    Bounds,
    Wave,
    direct,
    onward,
    onward_bounds,
    quadrature,
)
from simulator.visibility.mutual_visibility import Sight

GAUSS_LIMITS = (0.24, 1.28, 2.6)
"""Half the phase over a facet up to which one, two and three Gauss points are within 1 %. [rad]"""


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A wave from the ports over walls to a target, not yet worked out."""

    ports: Ports
    walls: tuple[Face, ...]  # in the order in which they are met, with the points of their phase
    sights: tuple[Sight, ...]  # of each wall and what follows it
    bounds: tuple[Bounds, ...]  # at what follows each wall; the last are those at the target
    through: int = 0  # frequencies that the slabs between walls ask for

    @property
    def spread(self) -> float:
        """Largest difference of lengths at one facet of the target. [m]."""
        return self.bounds[-1].spread

    @property
    def nodes(self) -> int:
        """Frequencies that the ports' pattern and slabs on the way ask for, beyond the walls."""
        return self.ports.nodes + self.through

    def part(self, chosen: slice | Int[np.ndarray, " chosen"]) -> "Passage":
        """Choose some of the target's facets."""
        return replace(
            self,
            sights=(
                *self.sights[:-1],
                self.sights[-1]._replace(seen=self.sights[-1].seen[:, chosen]),
            ),
            bounds=(*self.bounds[:-1], self.bounds[-1].part(chosen)),
        )

    def of_ports(self, some: slice) -> "Passage":
        """Choose some of the ports."""
        return replace(
            self,
            ports=self.ports.part(some),
            bounds=tuple(one.part(slice(None), some) for one in self.bounds),
        )

    def at_last_wall(self, nodes: Float[np.ndarray, " nodes"]) -> Wave:
        """Work out the wave that the last wall sends on."""
        wave = direct(self.walls[0], self.ports, nodes)
        for place, (wall, onto) in enumerate(pairwise(self.walls)):
            wave = onward(wave, wall, onto, self.sights[place], self.bounds[place], nodes)
        return wave

    def arriving(self, sent: Wave, target: Face, nodes: Float[np.ndarray, " nodes"]) -> Wave:
        """Work out what arrives of the wave at the last wall."""
        return onward(sent, self.walls[-1], target, self.sights[-1], self.bounds[-1], nodes)


@dataclass(frozen=True)
class Link:
    """Two waves that a target links: out and back, and how often their chain counts."""

    factor: float
    out: Passage
    back: "Passage | Ports"  # or directly, from these

    @property
    def spread(self) -> float:
        """Largest difference of lengths. [m]."""
        return self.out.spread + (self.back.spread if isinstance(self.back, Passage) else 0.0)

    @property
    def walls(self) -> tuple[Face, ...]:
        """All walls but the target."""
        return self.out.walls + (self.back.walls if isinstance(self.back, Passage) else ())

    @property
    def nodes(self) -> int:
        """Frequencies that the patterns of both ends, and slabs on the way, ask for."""
        ends = self.out.nodes, self.back.nodes
        return sum(ends)


def passages_over(
    ports: Ports,
    chain: Sequence[Face],
    target: Face,
    sees: Sees,
    frequencies: Float[np.ndarray, " freqs"],
) -> Iterator[Passage]:
    """Prepare the ways over walls, from the facets that the ports see; for each set of slabs."""
    first = chain[0].part(np.flatnonzero(ports.visible[:, chain[0].source].any(axis=0)))
    if first.count == 0:
        return
    start, highest = float(frequencies[0]), float(frequencies[-1])
    yet: list[tuple[tuple[Face, ...], tuple[Sight, ...]]] = [((), ())]
    chain = [first, *chain[1:]]
    for place in reversed(range(len(chain))):  # each wall's points depend on what follows
        before = chain[place - 1].centres if place else ports.positions[:, :2]
        yet = [
            ((wall, *walls), (sight, *sights))
            for walls, sights in yet
            for wall, sight in _towards(
                chain[place], walls[0] if walls else target, before, sees, highest
            )
        ]
    for walls, sights in yet:
        latest, bounds = direct(walls[0], ports, frequencies[:1]).bounds, []
        for wall, onto, sight in zip(walls, [*walls[1:], target], sights, strict=True):
            latest = onward_bounds(latest, wall, onto, sight.seen)
            bounds.append(latest)
        if latest.longest.any():
            through = [passage_nodes(sight.crossings, start, highest) - 1 for sight in sights]
            yield Passage(
                ports=ports, walls=walls, sights=sights, bounds=tuple(bounds), through=sum(through)
            )


def _towards(
    wall: Face,
    target: Face,
    before: Float[np.ndarray, "points 2"],
    sees: Sees,
    highest: float,
) -> Iterator[tuple[Face, Sight]]:
    """Choose the facets of a wall that see a target, with the points that their phase needs.

    The phase over a facet turns with the directions of the wave from ``before`` and of what
    goes to the target. One choice for each set of slabs between them.
    """
    for sight in sees.sights(wall, target):
        kept = np.flatnonzero(sight.seen.any(axis=1))
        points, count = _resolved(wall.part(kept), target, before, highest)
        seen = np.repeat(sight.seen[kept], count, axis=0)
        yield points, sight._replace(seen=seen)


def _resolved(
    wall: Face, target: Face, before: Float[np.ndarray, "points 2"], highest: float
) -> tuple[Face, int]:
    """Give each facet the points that its phase needs; and tell how many."""
    low, high = np.zeros(wall.count), np.zeros(wall.count)
    for points in (before, target.centres):
        apart = outline(points)[:, None] - wall.centres
        along = np.einsum("pfx,fx->pf", apart, wall.edges) / np.linalg.norm(apart, axis=-1)
        low, high = low + along.min(axis=0), high + along.max(axis=0)
    phase = np.pi * highest / speed_of_light * float(np.maximum(-low, high).max())
    count = 1 + sum(phase > limit for limit in GAUSS_LIMITS)
    return quadrature(wall, count), count
