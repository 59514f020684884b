"""A wave's passage from its ports over several walls to a target.

A :class:`Passage` is prepared once for all frequencies: the walls' facets that see the next face,
with the quadrature points for the phase over them, and bounds of all lengths. A :class:`Link`
joins two of them at a target (:mod:`simulator.multibounce.multibounce_2d`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from scipy.constants import speed_of_light

from simulator.antennas.ports import Ports
from simulator.geometry.faces import Face
from simulator.materials.slab_insertion import Crossing
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
"""Half the phase difference over a facet up to which the error of one, two and three Gauss points
is below 1 %. [rad]"""


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A wave from the ports over walls to a target, not yet evaluated."""

    ports: Ports
    walls: tuple[Face, ...]  # in order, with quadrature points
    sights: tuple[Sight, ...]  # between each wall and the next face
    bounds: tuple[Bounds, ...]  # at the face after each wall; the last at the target

    @property
    def spread(self) -> float:
        """Largest difference of lengths at one facet of the target. [m]."""
        return self.bounds[-1].spread

    @property
    def nodes(self) -> int:
        """Frequencies needed for the ports' patterns, beyond those for walls and slabs."""
        return self.ports.nodes - self.ports.slab_nodes

    @property
    def slabs(self) -> tuple[Crossing, ...]:
        """Slabs that the wave crosses, those between the ports and the first wall first."""
        between = (crossing for sight in self.sights for crossing in sight.crossings)
        return (*self.ports.slabs, *between)

    def part(self, chosen: slice | Int[np.ndarray, " chosen"]) -> "Passage":
        """Select some of the target's facets."""
        return replace(
            self,
            sights=(
                *self.sights[:-1],
                self.sights[-1]._replace(seen=self.sights[-1].seen[:, chosen]),
            ),
            bounds=(*self.bounds[:-1], self.bounds[-1].part(chosen)),
        )

    def of_ports(self, some: slice) -> "Passage":
        """Select some of the ports."""
        return replace(
            self,
            ports=self.ports.part(some),
            bounds=tuple(one.part(slice(None), some) for one in self.bounds),
        )

    def at_last_wall(self, nodes: Float[np.ndarray, " nodes"]) -> Wave:
        """Return the wave at the last wall."""
        wave = direct(self.walls[0], self.ports, nodes)
        for place, (wall, onto) in enumerate(pairwise(self.walls)):
            wave = onward(wave, wall, onto, self.sights[place], self.bounds[place], nodes)
        return wave

    def arriving(self, sent: Wave, target: Face, nodes: Float[np.ndarray, " nodes"]) -> Wave:
        """Return the wave at the target, from that at the last wall."""
        return onward(sent, self.walls[-1], target, self.sights[-1], self.bounds[-1], nodes)


@dataclass(frozen=True)
class Link:
    """Two waves linked by a target, out and back, and the weight of their chain."""

    factor: float
    out: Passage
    back: "Passage | Ports"  # ports: the direct wave

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
        """Frequencies needed for the patterns of both ends."""
        back = self.back.nodes - (0 if isinstance(self.back, Passage) else self.back.slab_nodes)
        return self.out.nodes + back

    @property
    def slabs(self) -> tuple[Crossing, ...]:
        """Slabs that the wave crosses on both ways."""
        return (*self.out.slabs, *self.back.slabs)


def passages_over(
    ports: Ports,
    chain: Sequence[Face],
    target: Face,
    sees: Sees,
    frequencies: Float[np.ndarray, " freqs"],
) -> Iterator[Passage]:
    """Yield the passages over a chain of walls, one for each set of slabs."""
    first = chain[0].part(np.flatnonzero(ports.visible[:, chain[0].source].any(axis=0)))
    if first.count == 0:
        return
    highest = float(frequencies[-1])
    yet: list[tuple[tuple[Face, ...], tuple[Sight, ...]]] = [((), ())]
    chain = [first, *chain[1:]]
    for place in reversed(range(len(chain))):  # each wall's points depend on the next face
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
            yield Passage(ports=ports, walls=walls, sights=sights, bounds=tuple(bounds))


def _towards(
    wall: Face,
    target: Face,
    before: Float[np.ndarray, "points 2"],
    sees: Sees,
    highest: float,
) -> Iterator[tuple[Face, Sight]]:
    """Yield the facets of a wall that see a target, with quadrature points, for each set of slabs.

    The phase over a facet depends on the directions of the wave from ``before`` and to the target.
    """
    for sight in sees.sights(wall, target):
        kept = np.flatnonzero(sight.seen.any(axis=1))
        points, count = _resolved(wall.part(kept), target, before, highest)
        seen = np.repeat(sight.seen[kept], count, axis=0)
        yield points, sight._replace(seen=seen)


def _resolved(
    wall: Face, target: Face, before: Float[np.ndarray, "points 2"], highest: float
) -> tuple[Face, int]:
    """Return the face with the quadrature points for its phase, and their number per facet."""
    low, high = np.zeros(wall.count), np.zeros(wall.count)
    for points in (before, target.centres):
        apart = outline(points)[:, None] - wall.centres
        along = np.einsum("pfx,fx->pf", apart, wall.edges) / np.linalg.norm(apart, axis=-1)
        low, high = low + along.min(axis=0), high + along.max(axis=0)
    phase = np.pi * highest / speed_of_light * float(np.maximum(-low, high).max())
    count = 1 + sum(phase > limit for limit in GAUSS_LIMITS)
    return quadrature(wall, count), count
