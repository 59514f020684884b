"""How strongly walls reflect: from users that are located already, else a stated assumption.

An image tells where a mirror is, not its reflection coefficient: the diffuse echo that shows it
depends on its roughness as well. A path that was received over it tells: what its gain lacks to
that of free space over the same length is the product of the coefficients of its walls.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

ASSUMED_DB = -6.0
"""20·log10 |Γ| of a wall of which nothing was received: half way between metal (0 dB) and 12.7 mm
of gypsum plasterboard near normal incidence (about -12 dB, ITU-R P.2040-4 at 110-330 GHz). [dB]"""
ASSUMED_DEVIATION_DB = 3.5
"""Standard deviation of what is spread evenly over those 12 dB: 12/√12. [dB]"""
ANTENNA_DEVIATION_DB = 3.0
"""How far the gain of a user's antenna towards a wall is from the 0 dBi that is taken. [dB]"""


@dataclass(frozen=True, kw_only=True)
class MeasuredGain:
    """A located user's path over walls, compared with free space."""

    walls: tuple[int, ...]  # from the array outward
    excess_db: float  # gain over λ/4πL [dB]
    deviation_db: float = ANTENNA_DEVIATION_DB


@dataclass(frozen=True, kw_only=True)
class Reflections:
    """What is known of 20·log10 |Γ| of each wall."""

    level_db: Float[np.ndarray, " walls"]
    covariance: Float[np.ndarray, "walls walls"]  # [dB²]

    def over(self, chain: Sequence[int]) -> tuple[float, float]:
        """Return the level over a chain of walls and its standard deviation [dB]."""
        times = np.bincount(np.asarray(chain, dtype=np.intp), minlength=self.level_db.size)
        variance = float(times @ self.covariance @ times)
        return float(times @ self.level_db), float(np.sqrt(max(variance, 0.0)))


def excess_db(gain: complex | float, path_length: float, frequency: float) -> float:
    r"""Return a path's gain over that of free space, :math:`|g| \, 4 \pi L / \lambda`. [dB].

    Parameters
    ----------
    gain
        S-parameter of the path, as :class:`estimator.wavefronts.wave_fit_2d.SphericalWave` has it.
    path_length
        [m]
    frequency
        Centre of the band. [Hz]
    """
    if not abs(gain) > 0:
        raise ValueError(f"gain = {gain}: a path that was received has a gain above 0")
    wavelength = speed_of_light / frequency
    return float(20 * np.log10(abs(gain) * 4 * np.pi * path_length / wavelength))


def wall_reflections(count: int, measured: Sequence[MeasuredGain] = ()) -> Reflections:
    r"""Estimate 20·log10 |Γ| of walls from the paths of users already located.

    In decibels a path's excess is the sum over its walls. With the assumption
    :math:`N(` :data:`ASSUMED_DB` :math:`,` :data:`ASSUMED_DEVIATION_DB` :math:`^2)` as the prior
    the answer is that of linear least squares: a wall that no path met keeps the assumption.

    Parameters
    ----------
    count
        Number of walls.
    measured
        Paths, each with its own error.

    Returns
    -------
    Levels, none above 0 dB: no wall gives more than it gets.

    Raises
    ------
    ValueError
        If a path names a wall that there is not.
    """
    precision = np.eye(count) / ASSUMED_DEVIATION_DB**2
    weighted = np.full(count, ASSUMED_DB / ASSUMED_DEVIATION_DB**2)
    for path in measured:
        if any(not 0 <= wall < count for wall in path.walls):
            raise ValueError(f"walls {path.walls} of a measured gain: there are {count} walls")
        times = np.bincount(np.asarray(path.walls, dtype=np.intp), minlength=count)
        precision = precision + np.outer(times, times) / path.deviation_db**2
        weighted = weighted + times * path.excess_db / path.deviation_db**2
    covariance = np.linalg.inv(precision)
    return Reflections(level_db=np.minimum(covariance @ weighted, 0.0), covariance=covariance)
