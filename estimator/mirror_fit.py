r"""A wall's line below the resolution cell: maximise the image's brightness along it.

For trial lines (angle, offset) the image is focused on points of the line itself, and

.. math:: J(\alpha, \rho) = \sum_s |I(p_s(\alpha, \rho))|

is maximised by ever finer grids; the magnitude leads there from farther off than the intensity,
which a few bright facets rule. The last step maximises

.. math:: K(\alpha, \rho) = \sum_s (1 - u_s^2)\, |I(p_s(\alpha, \rho))|^{3/2},
          \qquad -1 < u_s < 1 \text{ along the wall.}

Each wavenumber along an endless wall holds one unknown of its speckle, and its waves are in step
on the wall's line: the sum of the intensity of all of it is largest there, whatever the speckle
is. What one cell's speckle pushes off the line, its neighbours' parts take back. A finite wall
mixes the wavenumbers where the weight changes, and :math:`1 - u^2` makes that least for a tilt
(it minimises :math:`\int |(wu)'|^2 / (\int w u^2)^2`). A power between magnitude and intensity
bears walls whose own heights are what pushes. Over 124 realisations of six walls the tilt's
error fell to 0.4 to 0.8 of that of J's summit (rms heights up to 0.05 mm), and rose to 1.2 on one
of 0.1 mm.

The summit is that of a paraboloid fitted over most of a cell. The covariance comes from how
unevenly the parts of the wall push the line.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.special import gammaincc

from estimator.line_search import GAP, Resolution

Focus = Callable[[Float[np.ndarray, "*grid 3"]], Complex[np.ndarray, "*grid"]]
"""Focuses the echo on points."""

SAMPLES_PER_CELL = 2
TRIALS = 9
"""Trial angles and trial offsets of each round."""
ROUNDS = 4
"""Rounds; each looks at a third of the neighbourhood of the one before."""
MODES = 10
"""Smooth modes along the wall that tell how strongly speckle pushes a line: the weight times
polynomials, orthonormal, so that order 0 is what moves the line and order 1 what tilts it. Both
are at rest at the summit; those of higher order say how large they would be. A cell's speckle
pushes its neighbours' part of the line the other way, hence slow modes least."""
RISES = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0)
"""By how much the modes' power may rise with their rms slope along the wall, in units of that of
order 1. [-]"""
LEAST_POWER = 0.08
"""Power of a slow mode, over that of independent samples, that is assumed in any case: a few
modes can be low by chance. [-]"""
TILT_SHARE, OFFSET_SHARE = 1.3, 0.9
"""Variance of tilt and offset over what the modes let expect. From 124 realisations of six walls
(20 to 40 cm, 20° and 45°, 0.01 to 0.1 mm rms, metal and drywall, 30 and 75 GHz): 0.45 to 2.1,
and 0.5 to 1.3."""
SUMMIT_SAMPLES_PER_CELL = 4
"""Along the wall; the intensity has twice the image's bandwidth."""
BRIGHTNESS = 1.5
"""Power of the magnitude that K sums. [-]"""
PASSES = 3
"""Times that the paraboloid is fitted about its own summit."""
FEWEST_PLACES = 4
"""Places along a line that still have modes of a higher order than its tilt."""
SUMMIT = 0.6
"""Half the width of the neighbourhood that the paraboloid is fitted to. [cells]"""
CELLS_CUT = 2.0
"""Cells left out at either end: the sidelobes of an end, which lean, would tilt the line."""
CELLS_AT_END = 12.0
"""Cells either side of a wall's rough end that are searched for it."""
CELLS_OF_STEP = 3.0
"""Cells either side of an end whose mean levels differ most: speckle in so many leaves their mean
a deviation of 3 dB, and walls end by tens of decibels."""
END_LEVEL = 0.1
"""Intensity over the wall's local mean that still is wall: speckle falls below it in one cell
of ten, and the tapered main lobe reaches it 0.8 cells beyond an end."""


@dataclass(frozen=True, kw_only=True)
class FittedLine:
    """A segment in the array's frame, with the statistics of its angle and offset."""

    start: Float[np.ndarray, " 3"]  # [m]
    end: Float[np.ndarray, " 3"]  # [m]
    covariance: Float[np.ndarray, "2 2"]  # of (angle [rad], offset [m]) at the midpoint
    level: float  # mean intensity along it [-]
    background: float  # mean intensity beside it [-]
    confidence: float  # one minus the probability that background alone does this

    @property
    def middle(self) -> Float[np.ndarray, " 3"]:
        """Midpoint. [m]."""
        middle: np.ndarray = 0.5 * (self.start + self.end)
        return middle

    @property
    def length(self) -> float:
        """Length. [m]."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def direction(self) -> Float[np.ndarray, " 3"]:
        """Unit vector from start to end."""
        direction: np.ndarray = (self.end - self.start) / self.length
        return direction


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
    for half_width in (1.0, 0.3):  # in cells: once for the extent, once at the final extent
        refined = _refined(focus, start, end, resolution, half_width)
        extent = _extent(tapered, *refined, resolution, reach)
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
    The line, or ``None`` if it is too short to have an angle.
    """
    if _places(start, end, resolution).size < FEWEST_PLACES:
        return None
    start, end, covariance = _summit(focus, start, end, resolution)
    level, background = _levels(tapered, start, end, resolution)
    cells = np.linalg.norm(end - start) / _cell_along(start, end, resolution)
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


def across(start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Return a line's unit normal: its direction turned by -90 degrees in the array's plane."""
    along = (end - start) / np.linalg.norm(end - start)
    return np.array([along[1], -along[0], 0.0])


def _cell_along(
    start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], resolution: Resolution
) -> float:
    direction = (end - start) / np.linalg.norm(end - start)
    return float(resolution.cell(0.5 * (start + end), direction))


def _cell_across(
    start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], resolution: Resolution
) -> float:
    return float(resolution.cell(0.5 * (start + end), across(start, end)))


def _places(
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    per_cell: int = SAMPLES_PER_CELL,
) -> Float[np.ndarray, " places"]:
    """Sample a segment without its very ends, measured from its midpoint. [m]."""
    length = float(np.linalg.norm(end - start))
    cell = _cell_along(start, end, resolution)
    length -= min(2 * CELLS_CUT * cell, 0.5 * length)
    count = max(2, round(per_cell * length / cell))
    places: np.ndarray = (np.arange(count) + 0.5) / count * length - length / 2
    return places


def _trial_points(
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    places: Float[np.ndarray, " places"],
    tilts: Float[np.ndarray, " tilts"],
    offsets: Float[np.ndarray, " offsets"],
) -> Float[np.ndarray, "tilts offsets places 3"]:
    """Points of lines turned about the midpoint (counter-clockwise) and moved along the normal."""
    along = (end - start) / np.linalg.norm(end - start)
    normal = across(start, end)
    # The normal is the tangent turned by −90°, so a turn by δ moves the tangent by −δ·normal.
    tangents = np.cos(tilts)[:, None] * along - np.sin(tilts)[:, None] * normal
    normals = np.cos(tilts)[:, None] * normal + np.sin(tilts)[:, None] * along
    middle = 0.5 * (start + end)
    points: np.ndarray = (
        middle
        + offsets[None, :, None, None] * normals[:, None, None, :]
        + places[None, None, :, None] * tangents[:, None, None, :]
    )
    return points


def _refined(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    half_width: float,
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Maximise J over a neighbourhood of so many cells, by ever finer grids."""
    places = _places(start, end, resolution)
    width = half_width * _cell_across(start, end, resolution)
    length = float(np.linalg.norm(end - start))
    tilt = offset = 0.0
    for _ in range(ROUNDS):
        tilts = tilt + np.linspace(-2, 2, TRIALS) * width / length
        offsets = offset + np.linspace(-1, 1, TRIALS) * width
        magnitude = np.abs(focus(_trial_points(start, end, places, tilts, offsets)))
        objective = magnitude.sum(axis=-1)
        row, column = np.unravel_index(int(np.argmax(objective)), objective.shape)
        tilt, offset = float(tilts[row]), float(offsets[column])
        width /= 3
    ends = _trial_points(
        start, end, np.array([-length / 2, length / 2]), np.array([tilt]), np.array([offset])
    )[0, 0]
    return ends[0], ends[1]


def _extent(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    reach: tuple[float, float],
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]] | None:
    """Follow the line both ways until more than :data:`GAP` cells are dark."""
    along = (end - start) / np.linalg.norm(end - start)
    middle = 0.5 * (start + end)
    step = _cell_along(start, end, resolution) / SAMPLES_PER_CELL
    count = int(np.ceil(np.linalg.norm(end - start) / step)) + 1
    more = count  # as far again on either side
    places = (np.arange(-more, count + more) - (count - 1) / 2) * step
    points = middle + places[:, None] * along
    distance = np.linalg.norm(points, axis=-1)
    inside = (distance > reach[0]) & (distance < reach[1]) & (points[:, 1] > 0)
    places, points = places[inside], points[inside]
    intensity = np.abs(focus(points)) ** 2
    within = np.abs(places) <= np.linalg.norm(end - start) / 2
    level = float(np.median(intensity[within])) / np.log(2)
    background = _levels(focus, start, end, resolution)[1]
    # Halfway in decibels: the level of a wall varies by tens of them, above all with range.
    halfway = np.sqrt(level * background)
    occupied = np.nonzero(intensity > halfway)[0]
    if not within.any() or level < background or len(occupied) == 0:
        return None
    runs = np.split(occupied, np.nonzero(np.diff(occupied) > GAP * SAMPLES_PER_CELL)[0] + 1)
    run = max(runs, key=len)
    if len(run) < 2 or len(run) < 0.3 * (run[-1] - run[0] + 1):
        return None
    level_db = 10 * np.log10(np.maximum(intensity, halfway))
    outermost = len(places) - 1
    first = _end_of(level_db, int(run[0]))
    last = outermost - _end_of(level_db[::-1], outermost - int(run[-1]))
    if last - first < 2:
        return None
    return middle + places[first] * along, middle + places[last] * along


def _end_of(level_db: Float[np.ndarray, " places"], rough: int) -> int:
    """Return the first place that is wall, on a line that comes from outside.

    The end is the highest step between the means, in decibels, of the cells before it and after.
    What is scattered twice around a face that is seen over a mirror is a dim shoulder before its
    end; a face may also be tens of decibels brighter in its middle than at its ends.

    Parameters
    ----------
    level_db
        Intensity from outside to inside; not below what counts as dark. [dB]
    rough
        About where the wall begins.
    """
    near, wide = round(CELLS_AT_END * SAMPLES_PER_CELL), round(CELLS_OF_STEP * SAMPLES_PER_CELL)
    sums = np.concatenate([[0.0], np.cumsum(np.pad(level_db, wide, mode="edge"))])
    means = (sums[wide:] - sums[:-wide]) / wide
    steps = means[wide:-1] - means[: -wide - 1]  # after place i, less before it
    start = max(0, rough - near)
    step = start + int(np.argmax(steps[start : rough + near]))
    # A minimum of the speckle may be a higher step than the wall's end, a few cells further out.
    enough = np.median(level_db[step : step + near]) + 10 * np.log10(END_LEVEL / np.log(2))
    outer = max(0, step - 2 * wide)
    return outer + int(np.argmax(np.append(level_db[outer:step] > enough, True)))


def _summit(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"], Float[np.ndarray, "2 2"]]:
    r"""Move the line to the summit of K and return it with the covariance of its place.

    K is a sum over places i, :math:`w_i (c_i + g_i x + h_i x^2 / 2)` near the summit. Where the
    gradients :math:`g_i` of all places move the line is told by their smooth modes.
    """
    places = _places(start, end, resolution, SUMMIT_SAMPLES_PER_CELL)
    reach = 0.5 * len(places) * float(places[1] - places[0])  # half of the length in use
    levers = places / reach
    weights = 1 - levers**2
    length = float(np.linalg.norm(end - start))
    width = SUMMIT * _cell_across(start, end, resolution)
    scale = np.array([width / reach, width])
    unit = np.linspace(-1, 1, TRIALS)
    x, y = (axis.ravel() for axis in np.meshgrid(unit, unit, indexing="ij"))
    basis = np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2], axis=-1)
    for _ in range(PASSES):
        points = _trial_points(start, end, places, scale[0] * unit, scale[1] * unit)
        brightness = np.abs(focus(points)) ** BRIGHTNESS
        total = np.linalg.lstsq(basis, (brightness @ weights).ravel())[0]
        bread = np.linalg.inv(total[[3, 4, 4, 5]].reshape(2, 2))
        tilt, offset = scale * np.clip(-bread @ total[1:3], -1.0, 1.0)
        ends = _trial_points(
            start, end, np.array([-length / 2, length / 2]), np.array([tilt]), np.array([offset])
        )[0, 0]
        start, end = ends[0], ends[1]
    # Along the normal alone: a tilt moves the ends farther than a paraboloid describes.
    lines = np.stack([np.ones_like(unit), unit, unit**2 / 2], axis=-1)
    _, slopes, curvatures = np.linalg.lstsq(lines, brightness[TRIALS // 2])[0]
    curvature = float(curvatures @ weights)
    pushes = slopes - curvatures * float(slopes @ weights) / curvature
    at_rest, tilting = _slow_power(pushes, levers, weights)
    inertia = float(np.sum(weights * curvatures * levers**2))
    tilt_variance = TILT_SHARE * tilting * np.sum((weights * levers) ** 2) / inertia**2
    offset_variance = OFFSET_SHARE * at_rest * np.sum(weights**2) / curvature**2
    covariance = np.diag([tilt_variance, offset_variance])
    return start, end, covariance * np.outer(scale, scale)


def _slow_power(
    pushes: Float[np.ndarray, " places"],
    across: Float[np.ndarray, " places"],
    weights: Float[np.ndarray, " places"],
) -> tuple[float, float]:
    """Expect the power of the modes of order 0 and 1 from those of higher orders.

    Parameters
    ----------
    pushes
        Gradient at each place.
    across
        The places, from -1 to 1.
    weights
        Of the places in the fit.
    """
    count = min(MODES, max(4, len(pushes) // (2 * SUMMIT_SAMPLES_PER_CELL)))
    polynomials = np.polynomial.legendre.legvander(across, count - 1)
    modes = np.linalg.qr(polynomials * weights[:, None])[0]
    powers = (modes.T @ pushes) ** 2
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
    least = LEAST_POWER * float(np.mean(pushes**2))
    return max(likeliest[1], least), max(likeliest[2], least)


def _levels(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
) -> tuple[float, float]:
    """Mean intensity along the line, and the median-based one of lines beside it."""
    places = _places(start, end, resolution)
    cell = _cell_across(start, end, resolution)
    beside = cell * np.array([-12.0, -10.0, -8.0, -6.0, 0.0, 6.0, 8.0, 10.0, 12.0])
    points = _trial_points(start, end, places, np.zeros(1), beside)[0]
    intensity = np.abs(focus(points)) ** 2
    on = len(beside) // 2
    around = np.delete(intensity, on, axis=0)
    return float(intensity[on].mean()), float(np.median(around) / np.log(2))
