"""Legs over mirrors of which one is rough and scatters diffusely, and the reach of its facets."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from simulator.antennas.beam_culling import AntennaGroup
from simulator.geometry.mirrors import Mirrors
from simulator.specular.image_method import within_reach
from simulator.specular.image_sources import DIRECT, Leg

DIFFUSE_LEVEL = 0.1
"""Product of two field patterns, relative to their peaks, below which facets are left out: 1 % of
the diffuse power scattered from a wall in a Gaussian beam. [-]"""


@dataclass(frozen=True, kw_only=True)
class DiffuseLeg:
    """A leg from the array, its rough mirror, and the mirrors before and after that."""

    leg: Leg  # the specular leg over all mirrors
    rough: int
    before: Leg  # from the array to the rough mirror
    after: Leg  # from the other end to the rough mirror

    @property
    def bounces(self) -> int:
        """Number of mirrors."""
        return self.leg.bounces


def diffuse_legs(mirrors: Mirrors, legs: Sequence[Leg]) -> Iterator[DiffuseLeg]:
    """Yield each leg with each of its rough mirrors as the diffuse one."""
    for leg in legs:
        for place, mirror in enumerate(leg.sequence):
            if mirrors.rms_heights[mirror] > 0:
                yield DiffuseLeg(
                    leg=leg,
                    rough=mirror,
                    before=DIRECT.onward(mirrors, *leg.sequence[:place]),
                    after=DIRECT.onward(mirrors, *leg.sequence[:place:-1]),
                )


def may_reach(mirrors: Mirrors, chain: DiffuseLeg, array: AntennaGroup) -> bool:
    """Return whether rays over the mirrors before the rough one may meet it."""
    if not chain.before.sequence:
        return True
    images = chain.before.image(array).outline
    return bool(within_reach(mirrors, chain.before.sequence, images)[chain.rough])
