r"""A wall's line from the image, below the resolution cell: the image's brightness is maximised.

For trial lines (angle, offset) the image is focused on points of the line itself, and

.. math:: J(\alpha, \rho) = \sum_s |I(p_s(\alpha, \rho))|

is maximised by ever finer grids; the magnitude has a wider maximum than the intensity, which a few
bright facets dominate. The last step maximises

.. math:: K(\alpha, \rho) = \sum_s (1 - u_s^2)\, |I(p_s(\alpha, \rho))|^{3/2},
          \qquad -1 < u_s < 1 \text{ along the wall.}

The speckle of an infinite wall has one unknown amplitude for each wavenumber along it, and these
waves are in phase on the wall's line: the integral of the intensity is largest there for any
speckle, as errors that one cell causes are cancelled by its neighbours. On a finite wall the weight
mixes wavenumbers where it changes; :math:`1 - u^2` makes the resulting error of the tilt least (it
minimises :math:`\int |(wu)'|^2 / (\int w u^2)^2`). A power between magnitude and intensity is more
robust where the wall's own heights dominate the error. Over 124 realisations of six walls the
tilt's error fell to 0.4 to 0.8 of that of J's maximum (rms heights up to 0.05 mm), and rose to 1.2
on one of 0.1 mm.

The maximum is that of a paraboloid fitted over most of a cell. The covariance comes from the scores
(gradients of K) of the places along the wall.
"""

import numpy as np
from jaxtyping import Float
from scipy.special import gammaincc

from estimator.array.resolution_cell import Resolution
from estimator.imaging.focusing import Focus
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_extent import lit_extent
from estimator.walls.line_sampling import (
    cell_across,
    cell_along,
    levels,
    places_along,
    trial_points,
)

NEIGHBOURHOODS = (1.0, 0.3)
"""Half width over which J is maximised: once before the extent is known, once after. [cells]"""
TILT_RANGE = 2.0
"""Largest displacement of an end by a trial tilt, over that by a trial offset: the tilt of a line
between ends that are known to a cell each is so uncertain. [-]"""
TRIALS = 9
"""Trial angles and trial offsets of each round: a quarter of the half width apart. [-]"""
ROUNDS = 4
"""Grids of trials, each finer than the one before: to 1/27 of the first one's width. [-]"""
NARROWER = 3
"""Width of a round's neighbourhood over the next one's: 1.3 steps of the grid on either side. [-]
"""
MODES = 10
"""Smooth modes along the wall onto which the scores are projected: the weight times polynomials,
orthonormal. The mode of order 0 is the score of the offset, that of order 1 the score of the tilt.
Both are zero at the maximum by definition; the power that they would have is extrapolated from
higher orders. Scores of neighbouring cells are anticorrelated, so that smooth modes have least
power. [-]"""
RISES = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Models of the modes' power over their order, 1 + rise · slope, with the modes' rms slope along
the wall in units of that of order 1: the likeliest rise is used. [-]"""
LEAST_POWER = 0.08
"""Least power of orders 0 and 1, over that of uncorrelated scores: the few modes of higher order
may be low by chance. [-]"""
TILT_SHARE, OFFSET_SHARE = 1.3, 0.9
"""Variance of tilt and offset over what the modes let expect. From 124 realisations of six walls
(20 to 40 cm, 20° and 45°, 0.01 to 0.1 mm rms, metal and drywall, 30 and 75 GHz): 0.45 to 2.1,
and 0.5 to 1.3. ``python -m validation.experiments.thresholds walls``, with half the array and 12
realisations of each wall, gave 0.4 to 2.0 and 0.3 to 2.4 for walls of 20 cm up to 0.05 mm rms, but
4.2 and 3.8 at 0.1 mm rms, and 15.5 and 5.1 for a wall of 40 cm at 0.4 m: lines that the echo does
not place (:mod:`estimator.walls.line_refinement`) state too small a variance there. [-]"""
SUMMIT_SAMPLES_PER_CELL = 4
"""Along the wall; the intensity has twice the image's bandwidth. [-]"""
BRIGHTNESS = (1.5, 1.0, 0.5)
"""Powers of the magnitude that K sums, tried in turn until K has a maximum near the line. On a
rough wall whose level falls by tens of decibels, a few glints dominate the first power: it once
gave a line 0.7° off the wall with a smaller K than at the start. [-]"""
LEAST_RISE = 0.98
"""Least K at the fitted maximum, over K at the start: a maximum cannot be lower, but the paraboloid
is fitted to within a per cent or two. [-]"""
PASSES = 3
"""Times that the paraboloid is fitted about its own summit. [-]"""
FEWEST_PLACES = 4
"""Places along a line that still have modes of a higher order than its tilt. [-]"""
FEWEST_MODES = 4
"""Modes that are used, however short the line is: two beyond the tilt's, to extrapolate from.
[-]"""
SUMMIT = 0.6
"""Half the width of the neighbourhood that the paraboloid is fitted to: there the main lobe departs
from it by 1 %. [cells]"""


def fit_line(
    focus: Focus,
    tapered: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    *,
    reach: tuple[float, float],
    trials: int,
) -> FittedLine | None:
    """Refine a segment and find where it begins and ends.

    Parameters
    ----------
    focus
        Focuses the unweighted echo on points.
    tapered
        The same with low sidelobes: they would lengthen the wall.
    start, end
        The first guess, good to about a cell. [m]
    resolution
        Of the unweighted echo.
    reach
        Nearest and farthest distance from the array that can be focused. [m]
    trials
        How many lines were looked at, for the confidence.

    Returns
    -------
    The line, or ``None`` if nothing wall-like is left on it.
    """
    for half_width in NEIGHBOURHOODS:
        refined = _refined(focus, start, end, resolution, half_width)
        extent = lit_extent(tapered, *refined, resolution, reach)
        if extent is None:
            return None
        start, end = extent
    return fit_between(focus, tapered, start, end, resolution, trials=trials)


def fit_between(
    focus: Focus,
    tapered: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    *,
    trials: int,
) -> FittedLine | None:
    """Fit a line whose ends are known; see :func:`fit_line`.

    Returns
    -------
    The line; ``None`` if it is too short to have an angle or its brightness has no maximum.
    """
    if places_along(start, end, resolution).size < FEWEST_PLACES:
        return None
    summit = _summit(focus, start, end, resolution)
    if summit is None:
        return None
    start, end, covariance = summit
    level, background = levels(tapered, start, end, resolution)
    cells = np.linalg.norm(end - start) / cell_along(start, end, resolution)
    # The mean of n exponential variables is Gamma distributed; a trial is any line tried.
    false = float(gammaincc(cells, cells * level / background)) * trials
    return FittedLine(
        start=start,
        end=end,
        covariance=covariance,
        level=level,
        background=background,
        confidence=float(np.clip(1 - false, 0.0, 1.0)),
    )


def _refined(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    half_width: float,
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Maximise J over a neighbourhood of ``half_width`` cells, by ever finer grids."""
    places = places_along(start, end, resolution)
    width = half_width * cell_across(start, end, resolution)
    length = float(np.linalg.norm(end - start))
    tilt = offset = 0.0
    for _ in range(ROUNDS):
        tilts = tilt + np.linspace(-TILT_RANGE, TILT_RANGE, TRIALS) * width / length
        offsets = offset + np.linspace(-1, 1, TRIALS) * width
        magnitude = np.abs(focus(trial_points(start, end, places, tilts, offsets)))
        objective = magnitude.sum(axis=-1)
        row, column = np.unravel_index(int(np.argmax(objective)), objective.shape)
        tilt, offset = float(tilts[row]), float(offsets[column])
        width /= NARROWER
    ends = trial_points(
        start, end, np.array([-length / 2, length / 2]), np.array([tilt]), np.array([offset])
    )[0, 0]
    return ends[0], ends[1]


def _summit(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"], Float[np.ndarray, "2 2"]] | None:
    """Move the line to the maximum of K; return it with the covariance of its tilt and offset."""
    for power in BRIGHTNESS:
        found = _summit_of(focus, start, end, resolution, power)
        if found is not None:
            return found
    return None


def _summit_of(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    power: float,
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"], Float[np.ndarray, "2 2"]] | None:
    r"""Find the maximum of K near a line; ``None`` if it has none there.

    Near the maximum K is a sum over places i, :math:`w_i (c_i + g_i x + h_i x^2 / 2)`, with the
    scores :math:`g_i`.
    """
    places = places_along(start, end, resolution, SUMMIT_SAMPLES_PER_CELL)
    reach = 0.5 * len(places) * float(places[1] - places[0])  # half of the length in use
    levers = places / reach
    weights = 1 - levers**2
    length = float(np.linalg.norm(end - start))
    width = SUMMIT * cell_across(start, end, resolution)
    scale = np.array([width / reach, width])
    unit = np.linspace(-1, 1, TRIALS)
    x, y = (axis.ravel() for axis in np.meshgrid(unit, unit, indexing="ij"))
    basis = np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2], axis=-1)

    def height() -> float:
        here = trial_points(start, end, places, np.zeros(1), np.zeros(1))[0, 0]
        return float(np.abs(focus(here)) ** power @ weights)

    first = height()
    for _ in range(PASSES):
        points = trial_points(start, end, places, scale[0] * unit, scale[1] * unit)
        brightness = np.abs(focus(points)) ** power
        total = np.linalg.lstsq(basis, (brightness @ weights).ravel())[0]
        hessian = total[[3, 4, 4, 5]].reshape(2, 2)
        if np.linalg.eigvalsh(hessian)[-1] >= 0:
            return None
        tilt, offset = scale * np.clip(-np.linalg.solve(hessian, total[1:3]), -1.0, 1.0)
        ends = trial_points(
            start, end, np.array([-length / 2, length / 2]), np.array([tilt]), np.array([offset])
        )[0, 0]
        start, end = ends[0], ends[1]
    if height() < LEAST_RISE * first:
        return None  # a slope, not a maximum
    # Along the normal alone: a tilt moves the ends farther than a paraboloid describes.
    lines = np.stack([np.ones_like(unit), unit, unit**2 / 2], axis=-1)
    _, slopes, curvatures = np.linalg.lstsq(lines, brightness[TRIALS // 2])[0]
    curvature = float(curvatures @ weights)
    inertia = float(np.sum(weights * curvatures * levers**2))
    if curvature >= 0 or inertia >= 0:
        return None
    scores = slopes - curvatures * float(slopes @ weights) / curvature
    at_rest, tilting = _slow_power(scores, levers, weights)
    tilt_variance = TILT_SHARE * tilting * np.sum((weights * levers) ** 2) / inertia**2
    offset_variance = OFFSET_SHARE * at_rest * np.sum(weights**2) / curvature**2
    covariance = np.diag([tilt_variance, offset_variance])
    return start, end, covariance * np.outer(scale, scale)


def _slow_power(
    scores: Float[np.ndarray, " places"],
    across: Float[np.ndarray, " places"],
    weights: Float[np.ndarray, " places"],
) -> tuple[float, float]:
    """Extrapolate the power of the modes of order 0 and 1 from those of higher orders.

    Parameters
    ----------
    scores
        Gradient of K at each place.
    across
        The places, from -1 to 1.
    weights
        Of the places in the fit.
    """
    count = min(MODES, max(FEWEST_MODES, len(scores) // (2 * SUMMIT_SAMPLES_PER_CELL)))
    polynomials = np.polynomial.legendre.legvander(across, count - 1)
    modes = np.linalg.qr(polynomials * weights[:, None])[0]
    powers = (modes.T @ scores) ** 2
    slopes = np.sqrt(np.sum(np.gradient(modes, across, axis=0) ** 2, axis=0))
    # Powers are χ² distributed about a line over the slope: the likeliest of a few rises.
    likeliest = None
    for rise in RISES:
        shape = 1 + rise * slopes / slopes[1]
        level = float(np.mean(powers[2:] / shape[2:]))
        cost = float(np.sum(np.log(level * shape[2:])))
        if likeliest is None or cost < likeliest[0]:
            likeliest = (cost, level * float(shape[0]), level * float(shape[1]))
    assert likeliest is not None
    least = LEAST_POWER * float(np.mean(scores**2))
    return max(likeliest[1], least), max(likeliest[2], least)
