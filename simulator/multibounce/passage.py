"""A wave's way from its ports over several walls to a target, and which facets of each matter.

A :class:`Passage` is prepared once for all frequencies: the walls' facets that see what
follows, with the points that the phase over them needs, and bounds of all lengths. A
:class:`Link` joins two of them at a target (:mod:`simulator.multibounce.multibounce_2d`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.constants import speed_of_light

from simulator.antennas.ports import Ports
from simulator.geometry.faces import Face
from simulator.multibounce.chain_count import Sees, outline
from simulator.multibounce.iterative_physical_optics import (
    Bounds,
    Wave,
    direct,
    onward,
    onward_bounds,
    quadrature,
)

GAUSS_LIMITS = (0.24, 1.28, 2.6)
"""Half the phase over a facet up to which one, two and three Gauss points are within 1 %. [rad]"""


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A wave from the ports over walls to a target, not yet worked out."""

    ports: Ports
    walls: tuple[Face, ...]  # in the order in which they are met, with the points of their phase
    seen: tuple[Bool[np.ndarray, "_ _"], ...]  # of each wall and what follows it
    bounds: tuple[Bounds, ...]  # at what follows each wall; the last are those at the target

    @property
    def spread(self) -> float:
        """Largest difference of lengths at one facet of the target. [m]."""
        return self.bounds[-1].spread

    def part(self, chosen: slice | Int[np.ndarray, " chosen"]) -> "Passage":
        """Choose some of the target's facets."""
        return replace(
            self,
            seen=(*self.seen[:-1], self.seen[-1][:, chosen]),
            bounds=(*self.bounds[:-1], self.bounds[-1].part(chosen)),
        )

    def of_ports(self, some: slice) -> "Passage":
        """Choose some of the ports."""
        ports = replace(
            self.ports, positions=self.ports.positions[some], visible=self.ports.visible[some]
        )
        return replace(
            self, ports=ports, bounds=tuple(one.part(slice(None), some) for one in self.bounds)
        )

    def at_last_wall(self, nodes: Float[np.ndarray, " nodes"]) -> Wave:
        """Work out the wave that the last wall sends on."""
        wave = direct(self.walls[0], self.ports, nodes)
        for place, (wall, onto) in enumerate(pairwise(self.walls)):
            wave = onward(wave, wall, onto, self.seen[place], self.bounds[place], nodes)
        return wave

    def arriving(self, sent: Wave, target: Face, nodes: Float[np.ndarray, " nodes"]) -> Wave:
        """Work out what arrives of the wave at the last wall."""
        return onward(sent, self.walls[-1], target, self.seen[-1], self.bounds[-1], nodes)


@dataclass(frozen=True)
class Link:
    """Two waves that a target links: out and back, and how often their chain counts."""

    factor: float
    out: Passage
    back: Passage | None  # None: directly

    @property
    def spread(self) -> float:
        """Largest difference of lengths. [m]."""
        return self.out.spread + (0.0 if self.back is None else self.back.spread)

    @property
    def walls(self) -> tuple[Face, ...]:
        """All walls but the target."""
        return self.out.walls + (() if self.back is None else self.back.walls)


def passage_over(
    ports: Ports,
    chain: Sequence[Face],
    target: Face,
    sees: Sees,
    frequencies: Float[np.ndarray, " freqs"],
) -> Passage | None:
    """Prepare the way over walls, from the facets that the ports see; None if there is none."""
    first = chain[0].part(np.flatnonzero(ports.visible[:, chain[0].source].any(axis=0)))
    chain = [first, *chain[1:]]
    walls: list[Face] = []
    seen: list[Bool[np.ndarray, "_ _"]] = []
    for place in reversed(range(len(chain))):  # each wall's points depend on what follows
        before = chain[place - 1].centres if place else ports.positions[:, :2]
        onto = walls[0] if walls else target
        wall, sight = _towards(chain[place], onto, before, sees, float(frequencies[-1]))
        if wall.count == 0:
            return None
        walls.insert(0, wall)
        seen.insert(0, sight)
    latest, bounds = direct(walls[0], ports, np.ones(1)).bounds, []
    for wall, onto, sight in zip(walls, [*walls[1:], target], seen, strict=True):
        latest = onward_bounds(latest, wall, onto, sight)
        bounds.append(latest)
    if not latest.longest.any():
        return None
    return Passage(ports=ports, walls=tuple(walls), seen=tuple(seen), bounds=tuple(bounds))


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
        apart = outline(points)[:, None] - wall.centres
        along = np.einsum("pfx,fx->pf", apart, wall.edges) / np.linalg.norm(apart, axis=-1)
        low, high = low + along.min(axis=0), high + along.max(axis=0)
    phase = np.pi * highest / speed_of_light * float(np.maximum(-low, high).max())
    count = 1 + sum(phase > limit for limit in GAUSS_LIMITS)
    return quadrature(wall, count), np.repeat(seen, count, axis=0)
