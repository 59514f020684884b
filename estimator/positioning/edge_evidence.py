r"""Whether two points of the image are as bright as the edges of a mirror between them.

A mirror too smooth to be seen shows its two edges, and their levels are known
(:mod:`estimator.prediction.edge_echo`). With the levels :math:`\delta_1, \delta_2` of the two
points over those of the edges of a mirror of one kind, errors of :math:`\sigma`, and a gain of the
array's antennas that is none (the echo is calibrated, the antennas are isotropic: c) or any,

.. math:: p(\delta \mid \text{edges}) = c \, N(\delta_1; 0, \sigma^2) N(\delta_2; 0, \sigma^2)
          + (1 - c) \frac{1}{W} N(\delta_1 - \delta_2; 0, 2 \sigma^2)

against a density of :math:`1 / S^2` of any two points of an image.
"""

from dataclasses import dataclass
from math import exp, pi, sqrt

import numpy as np
from jaxtyping import Float

from estimator.prediction.echo_calibration import CALIBRATED, GAINS_DB
from estimator.prediction.edge_echo import edge_echoes_db

ACROSS = 1 / 3
"""Probability that the field is across the edges of mirrors, and not along: upright edges and an
upright polarisation are usual. [-]"""
COEFFICIENTS_DB = 25.0
"""Range of the reflection coefficients of boards and panes, below 1. [dB]"""
DEVIATION_DB = 2.0
"""Standard deviation of an edge's level: a pixel of the survey loses up to 1.8 dB of it. Edges of
smooth conductors at 20 to 65 degrees were within 0.4 dB, and of panes within 4 dB of each other's
(:func:`validation.trials.edge_levels.edge_rows`). [dB]"""
SPREAD_DB = 80.0
"""Range of the levels of unrelated points. [dB]"""
OTHERWISE = 0.1
"""Probability that the edges of a mirror are no such edges: hidden in part, curved, rounded or
beside something else. [-]"""


@dataclass(frozen=True, kw_only=True)
class EdgeOdds:
    """How much likelier two levels are of a mirror's edges than of unrelated points. [-]."""

    metal: float = 1.0  # of a conductor
    lossy: float = 1.0  # of a board or a pane


UNTOLD = EdgeOdds()
"""Where no level tells."""


def odds_of_edges(
    edges: Float[np.ndarray, "2 3"], levels_db: Float[np.ndarray, " 2"], frequency: float
) -> EdgeOdds:
    """Return how much likelier two levels are of a mirror's edges than of unrelated points.

    Parameters
    ----------
    edges
        Where the two points are seen, in the array's frame. [m]
    levels_db
        Of their echoes: 20 log10 of S-parameters. [dB]
    frequency
        Centre of the band. [Hz]
    """
    over = levels_db - edge_echoes_db(edges, frequency)
    alike = [_normal(float(first - second), sqrt(2) * DEVIATION_DB) for first, second in over]
    along, across = (
        CALIBRATED * _normal(float(first), DEVIATION_DB) * _normal(float(second), DEVIATION_DB)
        + (1 - CALIBRATED) * same / GAINS_DB
        for (first, second), same in zip(over[:2], alike[:2], strict=True)
    )
    within = -COEFFICIENTS_DB < float(over[2].mean()) < 0
    lossy = alike[2] * (
        CALIBRATED * within / COEFFICIENTS_DB + (1 - CALIBRATED) / (GAINS_DB + COEFFICIENTS_DB)
    )
    return EdgeOdds(
        metal=_against_chance((1 - ACROSS) * along + ACROSS * across), lossy=_against_chance(lossy)
    )


def _against_chance(density: float) -> float:
    return OTHERWISE + (1 - OTHERWISE) * density * SPREAD_DB**2


def _normal(value: float, deviation: float) -> float:
    return exp(-0.5 * (value / deviation) ** 2) / (sqrt(2 * pi) * deviation)
