"""A straight wall as it was fitted to the image."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.lateness import Lateness
from estimator.geometry.wall_2d import unit_normal

MOST_UNCERTAIN = 0.5
"""Largest standard deviation of a wall's ends and of its offset: what is known no better is no line
but scattered peaks, and a fit to the echo is not linear over more. True walls have 0.03 at most
(``python -m validation.experiments.thresholds walls``); in noise, rows of scatterers of two random
rooms were known to 19° and 234°, and their lines in the image to 0.05° and 0.3°. [cells]"""


@dataclass(frozen=True, kw_only=True)
class FittedLine:
    """A segment in the array's frame, with the statistics of its angle and offset."""

    start: Float[np.ndarray, " 3"]  # [m]
    end: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "2 2"]  # of (angle [rad], offset [m]) at the midpoint
    level: float  # mean intensity along it [-]
    background: float  # mean intensity beside it [-]
    confidence: float  # one minus the probability that background alone does this
    explained: float = 1.0  # share of its echo that a row of scatterers explains, if examined [-]

    late: Lateness | None = None  # by how much its echo is later than curved, if that was found

    @property
    def middle(self) -> Float[np.ndarray, " 3"]:
        """Midpoint. [m]."""
        middle: np.ndarray = 0.5 * (self.start + self.end)
        return middle

    @property
    def normal(self) -> Float[np.ndarray, " 3"]:
        """Unit normal, to the right of start to end."""
        return unit_normal(self.start, self.end)

    @property
    def length(self) -> float:
        """Length. [m]."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def direction(self) -> Float[np.ndarray, " 3"]:
        """Unit vector from start to end."""
        direction: np.ndarray = (self.end - self.start) / self.length
        return direction


def is_uncertain(line: FittedLine, resolution: Resolution) -> bool:
    """Tell whether a line's ends or its offset are known no better than to part of a cell."""
    deviations = np.sqrt(np.diag(line.covariance)) * [0.5 * line.length, 1.0]
    cell = float(resolution.cell(line.middle, line.normal))
    return bool(np.any(deviations > MOST_UNCERTAIN * cell))
