"""How much later waves arrive than their curvature says: a delay that is none of the room's."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Lateness:
    """A delay, as a distance."""

    shift: float  # beyond the radius of curvature: one way [m]
    deviation: float  # [m]
    distance: float  # at which the waves arrive [m]

    @property
    def deviations(self) -> float:
        """Its size over its deviation. [-]."""
        return abs(self.shift) / self.deviation


def combined(several: Sequence[Lateness]) -> Lateness | None:
    """Return the mean, weighted by variance; None of nothing.

    Where they disagree by more than their deviations, its deviation grows accordingly (Birge's
    ratio).
    """
    if not several:
        return None
    weights = np.array([one.deviation**-2 for one in several])
    shifts = np.array([one.shift for one in several])
    mean = float(weights @ shifts / weights.sum())
    square = float(weights @ (shifts - mean) ** 2)
    ratio = max(1.0, square / (len(several) - 1)) if len(several) > 1 else 1.0
    return Lateness(
        shift=mean,
        deviation=float(np.sqrt(ratio / weights.sum())),
        distance=float(weights @ np.array([one.distance for one in several]) / weights.sum()),
    )
