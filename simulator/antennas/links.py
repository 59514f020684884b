"""Antennas at both ends of links, and products of factors along both legs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from simulator.antennas.antenna_pattern import AntennaPattern
from simulator.antennas.polarization import Polarization

PAIRS_AT_ONCE = 100_000
"""Links times patches whose factors are computed in one batch. [-]"""

LegFactor = Callable[[Float[np.ndarray, "some 3"], Polarization], np.ndarray]
"""Factor [patches, some, nodes] of the legs between patches and antennas, from the antennas'
positions [m] and polarization."""


@dataclass(frozen=True, kw_only=True)
class Links:
    """Positions and patterns of both ends, pairwise; monostatic if both are the same object."""

    senders: Float[np.ndarray, "links 3"]  # [m]
    receivers: Float[np.ndarray, "links 3"]  # [m]
    sent: AntennaPattern
    received: AntennaPattern

    @property
    def echo(self) -> bool:
        """Whether the links are monostatic."""
        return self.receivers is self.senders and self.received is self.sent

    def product_over_legs(
        self, out: LegFactor | None, back: LegFactor | None, *, patches: int, nodes: int
    ) -> Complex[np.ndarray, "patches links nodes"]:
        """Multiply the factors of the legs to and from patches, some links at a time. [-].

        Parameters
        ----------
        out, back
            Factor of the leg from the senders, and of that to the receivers; None: 1.
        patches, nodes
            Numbers of patches and of frequencies.
        """
        total = np.ones((patches, len(self.receivers), nodes), dtype=np.complex128)
        at_once = max(1, PAIRS_AT_ONCE // max(1, patches))
        for factor, places, pattern in (
            (out, self.senders, self.sent),
            (back, self.receivers, self.received),
        ):
            if factor is None:
                continue
            for first in range(0, len(places), at_once):
                some = slice(first, first + at_once)
                total[:, some] *= factor(places[some], pattern.polarization)
        return total
