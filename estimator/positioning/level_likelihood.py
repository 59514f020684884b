r"""Likelihood of a path's level given its number of reflections.

A path of length L between isotropic antennas has the amplitude :math:`\lambda / 4 \pi L`, and each
reflection takes some of it. The gain of the user's antenna is unknown: it may be isotropic (0 dBi)
or have any gain
towards the array. So the density of the excess over free space after n reflections is,
in decibels,

.. math:: p(e \mid n) = \tfrac12 b_n [(1 - m^n) N(e; n \mu, \sigma_0^2 + n \sigma^2)
          + m^n N(e; 0, \sigma_0^2)] + \tfrac12 U(e; -40, +25) ,

with a wall's reflection μ ± σ as :mod:`estimator.prediction.wall_reflection` assumes it. An
isotropic user that is received over a mirror is also received over the direct path, which is
shorter, unless that path is blocked: :math:`b_n` is the probability of blockage if no earlier path
was found, and 1 otherwise. So a path at the level of free space is probably the direct one:
mirrors attenuate, if only by their roughness, and so does a beam that is not aimed at the array.
With the probability m a mirror is a smooth conductor without loss, which the level alone cannot
distinguish from the direct path. In
2500 random rooms, by the image method, 1061 of 1903 direct strongest paths and 3 of 176 reflected
ones were within 0.3 dB of it.
"""

from math import exp, hypot, pi, sqrt
from typing import Literal

from scipy.special import ndtr

from estimator.channel.path import Path
from estimator.compute.distributions import normal_density
from estimator.prediction.wall_reflection import ASSUMED_DB, ASSUMED_DEVIATION_DB, excess_db

Way = Literal["direct", "reflected", "through"]
"""How a wave came: through free space, over mirrors, or through a wall."""

ISOTROPIC = 0.5
"""Prior probability that a user's antenna is an isotropic one: nothing is known of it. [-]"""
LEAST_DB, MOST_DB = -40.0, 25.0
"""Gains towards the array that other antennas may have: from a deep null to the main lobe of a
horn: standard ones have 20 to 25 dBi. Only the width of the range counts, by its logarithm: 50 dBi
take 0.3 of the ln 1000 that make a place certain. In five of the rooms of ``python -m
validation.experiments.thresholds decisions`` probabilities move with 12.5 and 50 dBi, and no
answer. [dBi]"""
LEVEL_DEVIATION_DB = 0.1
"""Standard deviation of a strong path's level. Of 17 direct paths of tuning rooms all were 0.03 to
0.08 dB over free space at the centre of the band. [dB]"""
BLOCKED = 0.2
"""Probability that something blocks the straight way to a user whom a mirror shows. In five of the
rooms of ``python -m validation.experiments.thresholds decisions`` half and twice of it move one
user's probability, by 0.7 of the ln 1000 that make a place certain at most, and no answer. [-]"""
SMOOTH_METAL = 1 / 10
"""Probability that a mirror is a conductor too smooth to lose anything, and to be seen. In 2500
random rooms 3 of some 88 isotropic users' reflected paths were within 0.3 dB of free space; but
cabinets and whiteboards are smoother than the walls of those, of 0.02 mm rms and more. [-]"""
THROUGH_DB_PER_GHZ = 8 / 250
"""Least loss in a wall that a wave crosses, over the frequency: 4 mm of glass take 8 dB at 250 GHz,
half an inch of plasterboard 24 dB (ITU-R P.2040-4). [dB/GHz]"""
AIMED_THROUGH = 1e-3
"""Probability that a user behind a wall has an antenna with gain that is aimed at the array through
the wall. A horn of 23 dBi that is aimed anywhere in space meets the array in one of 200 cases, and
half of the antennas have a gain; but they are aimed at what they see. In five of the rooms of
``python -m validation.experiments.thresholds decisions`` half and twice of it move probabilities,
and no answer. [-]"""
REFLECTED_TILT, REFLECTED_TILT_DEVIATION = -1.0, 1.5
"""Tilt of a reflected wave's level and its deviation over a band of 0.29 of the frequency: 0.05 mm
of roughness take 0.4 dB more at its upper end at 45°, 0.15 mm 3.3 dB. Of four reflected paths of
tuning rooms it was -0.2 to -1.5 dB. [dB]"""
TILT_BAND = 0.29
"""Relative bandwidth of those. [-]"""
THROUGH_TILT, MOST_THROUGH_TILT = 1.0, 72.0
"""Tilt of a wave that came through a wall, over the relative bandwidth: the least loss is alike for
all laws of absorption from f on, the most is 40 dB by f^1.8 (plasterboard, ITU-R P.2040-4).
Of two such paths of tuning rooms, through glass at 220-295 GHz, it was -5.3 and -6.3 dB. [dB]"""
TILT_ERRORS = ((0.95, 0.1), (0.05, 1.5))
"""Shares of measured tilts and their standard deviations: of 38 direct paths of random rooms 34 had
-0.18 to 0.11 dB, and the others, beside waves nearer than the gate, up to 2.6 dB. [-], [dB]"""
MOST_BY_TILT = 1e3
"""Most that a tilt may weigh: the laws of absorption of no material are known that well. [-]"""
TOLD_TO_DB = 1.0
"""Excess beyond which the antenna has a gain, or the receiver is not calibrated: a level then
tells nothing. [dB]"""


def path_excess_db(path: Path, frequency: float | None) -> float | None:
    """Return the excess of a path over free space, None where its level tells nothing. [dB].

    Parameters
    ----------
    path
        The path.
    frequency
        Centre of the band, None if unknown. [Hz]
    """
    gain = abs(path.wave.gain)
    if frequency is None or not gain > 0:
        return None
    excess = excess_db(gain, path.wave.path_length, frequency)
    return told_excess_db(excess)


def told_excess_db(excess: float) -> float | None:
    """Return an excess if it tells something: not above free space. [dB]."""
    return excess if LEAST_DB < excess < TOLD_TO_DB else None


def level_density(
    excess: float,
    reflections: int,
    *,
    first: bool = True,
    blocked: float = BLOCKED,
    tilted: float = 1.0,
    smooth: float = 1.0,
) -> float:
    """Return the density of an excess, and of its tilt over a direct path's. [1/dB].

    Parameters
    ----------
    excess
        Over free space. [dB]
    reflections
        On the way.
    first
        Whether no path arrives before it.
    blocked
        Probability that something blocks the straight way to the user. [-]
    tilted
        How much likelier the path's tilt is of a reflected wave than of a direct one; a conductor
        without loss tilts nothing. [-]
    smooth
        How much likelier what else is known is of such conductors than of none. [-]
    """
    seen = blocked if first and reflections else 1.0
    deviation = sqrt(LEVEL_DEVIATION_DB**2 + reflections * ASSUMED_DEVIATION_DB**2)
    away = (excess - reflections * ASSUMED_DB) / deviation
    normal = exp(-0.5 * away**2) / (sqrt(2 * pi) * deviation)
    lossless = exp(-0.5 * (excess / LEVEL_DEVIATION_DB) ** 2) / (sqrt(2 * pi) * LEVEL_DEVIATION_DB)
    metal = SMOOTH_METAL**reflections
    lossy = (1 - metal) * (tilted if reflections else 1.0)
    metal *= smooth
    aimed = (1 - ISOTROPIC) / (MOST_DB - LEAST_DB)
    return ISOTROPIC * seen * (lossy * normal + metal * lossless) + aimed * (lossy + metal)


def through_density(excess: float, frequency: float) -> float:
    """Return the density of an excess behind one wall that lets waves through. [1/dB].

    Parameters
    ----------
    excess
        Over free space. [dB]
    frequency
        Centre of the band. [Hz]
    """
    most = -THROUGH_DB_PER_GHZ * frequency / 1e9
    alike = (1 - AIMED_THROUGH) / (most - LEAST_DB) if LEAST_DB < excess < most else 0.0
    return alike + AIMED_THROUGH / (MOST_DB - LEAST_DB)


def by_tilt(tilt: float, frequency: float, bandwidth: float, *, way: Way, over: Way) -> float:
    """Return how much likelier a tilt is of a wave that came one way than of another's. [-].

    Parameters
    ----------
    tilt
        Change of the level over the band, over that of free space. [dB]
    frequency, bandwidth
        Centre and width of the band. [Hz]
    way, over
        Both ways.
    """
    one, other = (_tilt_density(tilt, frequency, bandwidth, w) for w in (way, over))
    if one > MOST_BY_TILT * other:
        return MOST_BY_TILT
    return max(one / other, 1 / MOST_BY_TILT)


def _tilt_density(tilt: float, frequency: float, bandwidth: float, way: Way) -> float:
    """Return the density of a measured tilt. [1/dB]."""
    share = bandwidth / frequency
    wide = share / TILT_BAND
    if way != "through":
        mean = REFLECTED_TILT * wide if way == "reflected" else 0.0
        spread = REFLECTED_TILT_DEVIATION * wide if way == "reflected" else 0.0
        return sum(
            chance * float(normal_density(tilt, mean, hypot(spread, error)))
            for chance, error in TILT_ERRORS
        )
    least = THROUGH_TILT * THROUGH_DB_PER_GHZ * frequency / 1e9 * share
    most = MOST_THROUGH_TILT * share
    return sum(
        chance * float(ndtr((-least - tilt) / error) - ndtr((-most - tilt) / error))
        for chance, error in TILT_ERRORS
    ) / (most - least)
