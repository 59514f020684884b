"""What slabs insert between blocks of facets, for the butterfly sum of links through them.

A slab's coefficient depends on the direction of a link, which varies little between two blocks: it
is interpolated from the blocks' points as spreading and directions are, with as many more points as
its own variation needs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64, Float
from scipy.fft import dct

from simulator.materials.insertion_table import InsertionTable
from simulator.materials.reflection_table import Angles
from simulator.numerics.butterfly import LINK_ACCURACY, BlockPair, LinkPlan, phasor
from simulator.numerics.nufft_sum import chebyshev_nodes

MOST_ORDERS = 32
"""Most points along one axis that a slab adds: beyond, links are summed one by one. [-]"""

FREQUENCIES = 5
"""Frequencies at which a slab's variation over the angle is judged. [-]"""


@dataclass(frozen=True)
class SlabVariation:
    """How many points slabs need beyond those of free space."""

    slabs: Sequence[InsertionTable]

    def __call__(self, directions: Float[np.ndarray, "n 2"]) -> int:
        """Count the points that interpolate all slabs' coefficients over a range of directions.

        Parameters
        ----------
        directions
            Unit vectors that span the range.
        """
        return sum(self._orders(slab, directions) for slab in self.slabs)

    def _orders(self, slab: InsertionTable, directions: Float[np.ndarray, "n 2"]) -> int:
        cosines = np.minimum(np.abs(directions @ slab.crossing.normal[:2]), 1.0)
        angles = np.arccos([cosines.max(), cosines.min()])
        if angles[1] - angles[0] < 1e-9:
            return 0
        points = chebyshev_nodes(float(angles[0]), float(angles[1]), 2 * MOST_ORDERS)
        rows = slab.table.samples
        step = max(1, (len(rows) - 1) // (FREQUENCIES - 1))
        values = slab.table.at(slab.table.places(np.cos(points)), slice(None, None, step))
        sizes = np.abs(dct(values.real, axis=-1) + 1j * dct(values.imag, axis=-1)).max(axis=0)
        tail = np.cumsum(sizes[::-1])[::-1] / (2 * MOST_ORDERS)
        return int(np.count_nonzero(tail[1:] > LINK_ACCURACY * np.abs(rows).max()))


@dataclass(frozen=True, kw_only=True)
class BlockInsertions:
    """Slabs between the points of each pair of blocks of a plan."""

    angles: dict[tuple[int, int], tuple[tuple[InsertionTable, Angles], ...]]
    longer: dict[tuple[int, int], Float[np.ndarray, "from to"]]  # by bending [m]

    @classmethod
    def of(cls, plan: LinkPlan, slabs: Sequence[InsertionTable]) -> "BlockInsertions | None":
        """Prepare the slabs for all frequencies; none if there are no slabs."""
        if not slabs:
            return None
        angles, longer = {}, {}
        for pair in plan.pairs:
            key = pair.sender, pair.receiver
            ways = np.moveaxis(pair.directions.astype(np.float64), 0, -1)
            lengths = 1.0 / pair.spreading.astype(np.float64) ** 2
            angles[key] = tuple((slab, slab.places(ways)) for slab in slabs)
            longer[key] = sum((slab.bending(ways, lengths) for slab in slabs), np.zeros(()))
        return cls(angles=angles, longer=longer)

    def at(self, pair: BlockPair, node: int, per_metre: float) -> Complex64[np.ndarray, "from to"]:
        """Return the factor of all slabs between two blocks' points at one of the frequencies."""
        key = pair.sender, pair.receiver
        factor = phasor(-per_metre * self.longer[key])
        for slab, angles in self.angles[key]:
            factor = factor * slab.table.at(angles, node)
        return np.asarray(factor)
