r"""Where the patterns of two antennas reach: facets elsewhere are neither made nor summed.

Of a facet, the two patterns multiply. Left out is where their product is surely below
:data:`LEVEL` of the product of their peaks. For a facet set whose sum would be :math:`S_0` if
both antennas looked at all of it with their peak gains, in whatever phases, what is left out is
at most :math:`\mathrm{LEVEL} \sum |s|` with the facets' contributions :math:`s` at peak gains.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from scenes.schema.antenna import Isotropic
from simulator.antennas.antenna_pattern import AntennaPattern

LEVEL = 1e-3
"""Product of two field patterns, over that of their peaks, that is left out: -60 dB. [-]"""


@dataclass(frozen=True, kw_only=True)
class AntennaGroup:
    """Equal antennas that look in parallel, close together."""

    positions: Float[np.ndarray, "antennas 3"]  # [m]
    pattern: AntennaPattern

    @property
    def centre(self) -> Float[np.ndarray, " 3"]:
        """Middle of the antennas [m]."""
        middle: np.ndarray = (self.positions.min(axis=0) + self.positions.max(axis=0)) / 2
        return middle

    @property
    def outline(self) -> Float[np.ndarray, "places 3"]:
        """Corners of the antennas' bounding box, and its middle [m].

        Of all antennas one of these sees a place at the least angle off its axis, but for
        places straight ahead, where the pattern is flat.
        """
        low, high = self.positions.min(axis=0), self.positions.max(axis=0)
        ends = [np.unique([a, b]) for a, b in zip(low, high, strict=True)]
        corners = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3)
        return np.concatenate([corners, self.centre[None]])

    def at_most(
        self,
        centres: Float[np.ndarray, "spheres 3"],
        radius: float | Float[np.ndarray, " spheres"],
    ) -> Float[np.ndarray, " spheres"]:
        """Bound the field of any of the antennas anywhere in spheres, over that on axis. [-]."""
        if isinstance(self.pattern.antenna, Isotropic):
            return np.ones(len(centres))
        most = np.zeros(len(centres))
        for place in self.outline:
            towards = centres - place
            distance = np.maximum(np.sqrt(np.einsum("sx,sx->s", towards, towards)), 1e-9)
            spread = np.minimum(radius / distance, 1.0)
            width = np.where(spread < 1.0, np.arcsin(spread), np.pi)
            angles = np.maximum(self.pattern.off_axis(towards / distance[:, None]) - width, 0.0)
            most = np.maximum(most, self.pattern.field_off_axis(angles))
        return most


def in_reach(
    pairs: Sequence[tuple[AntennaGroup, AntennaGroup]],
    centres: Float[np.ndarray, "spheres 3"],
    radius: float,
    *,
    level: float = LEVEL,
) -> Bool[np.ndarray, " spheres"]:
    """Tell which spheres the patterns of any of some pairs of antennas reach.

    Parameters
    ----------
    pairs
        Both ends of the links.
    centres, radius
        The spheres. [m]
    level
        Product of the patterns, over that of their peaks, that is left out. [-]
    """
    reached = np.zeros(len(centres), dtype=bool)
    # An antenna is in many pairs: its bounds are evaluated once, where no pair before reached.
    known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def bounds(group: AntennaGroup, left: np.ndarray) -> np.ndarray:
        if id(group) not in known:
            known[id(group)] = left, group.at_most(centres[left], radius)
        where, values = known[id(group)]
        return np.asarray(values[np.searchsorted(where, left)])

    for one, other in pairs:
        left = np.flatnonzero(~reached)
        if left.size == 0:
            break
        reached[left] = bounds(one, left) * bounds(other, left) >= level
    return reached
