"""Antennas at both ends of links."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from simulator.antennas.antenna_pattern import AntennaPattern


@dataclass(frozen=True, kw_only=True)
class Links:
    """Places between which waves travel, pairwise; echoes if both are the same object."""

    senders: Float[np.ndarray, "links 3"]  # [m]
    receivers: Float[np.ndarray, "links 3"]  # [m]
    sent: AntennaPattern
    received: AntennaPattern

    @property
    def echo(self) -> bool:
        """Whether each wave returns to where it came from."""
        return self.receivers is self.senders and self.received is self.sent
