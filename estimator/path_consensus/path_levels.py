r"""What the levels of listed paths tell of the number of reflections.

The level over that of free space, e, has the density :math:`N(e; 0, \sigma_0^2)` on the direct way
and

.. math:: (1 - m^n) N(e; n \mu, \sigma_0^2 + n \sigma^2) + m^n N(e; 0, \sigma_0^2)

after n reflections, with μ ± σ of :mod:`estimator.prediction.wall_reflection` and the probability m
of a conductor without loss; any level up to 40 dB below free space is alike for a path from
anywhere.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.compute.distributions import normal_density
from estimator.measurement.path_list import PathList
from estimator.positioning.level_likelihood import LEAST_DB, SMOOTH_METAL
from estimator.prediction.wall_reflection import ASSUMED_DB, ASSUMED_DEVIATION_DB

ORDERS = 4
"""Numbers of reflections: none to three. [-]"""
ABOVE_DB = 5.0
"""Level over free space up to which a path from anywhere is looked for. [dB]"""


def free_space_db(lists: Sequence[PathList]) -> tuple[np.ndarray, float] | None:
    """Return all levels over those of free space at a length of 1 m, and their deviation. [dB].

    None, where a list has no calibrated levels.
    """
    levels = []
    for one in lists:
        if one.gain_db is None or one.frequency is None:
            return None
        wavelength = speed_of_light / one.frequency
        levels.append(one.gain_db - 20 * np.log10(wavelength / (4 * np.pi)))
    return np.concatenate(levels), max(one.gain_deviation_db for one in lists)


def level_gains(
    excess: Float[np.ndarray, " paths"], deviation: float
) -> Float[np.ndarray, "paths orders"]:
    """Return the log-likelihood of each number of reflections, over that of a path from anywhere.

    Parameters
    ----------
    excess
        Levels over those of free space. [dB]
    deviation
        Standard deviation of the levels. [dB]
    """
    gains = np.empty((excess.size, ORDERS))
    for order in range(ORDERS):
        metal = SMOOTH_METAL**order
        spread = np.hypot(deviation, np.sqrt(order) * ASSUMED_DEVIATION_DB)
        density = (1 - metal) * normal_density(excess, order * ASSUMED_DB, spread)
        density = density + metal * normal_density(excess, 0.0, deviation)
        gains[:, order] = np.log(np.maximum(density, 1e-30))
    return np.asarray(gains + np.log(ABOVE_DB - LEAST_DB))
