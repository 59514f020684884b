"""The ends of a wall along its line: the highest step of the level near its last bright cells.

A flat face that is seen over a mirror ends where its own level ends. Only the outer elements of the
array receive the specular reflection of the face's ends: a taper over the array, which suppresses
the sidelobes of a wall's ends, attenuates them down to the level of the diffuse multipath beside
them. Without the taper a face is as bright at its ends as in its middle.
"""

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from estimator.array.resolution_cell import Resolution
from estimator.imaging.focusing import Focus
from estimator.imaging.peak_detection import mean_background
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_detection import GAP
from estimator.walls.line_sampling import BESIDE, SAMPLES_PER_CELL, cell_along, levels

CELLS_AT_END = 12.0
"""Distance to either side of a wall's rough end that is searched for it: a dim shoulder
(:func:`end_of`) may pass for wall so far before it. ``python -m
validation.experiments.thresholds limits``: of eight echoes in closed form and six simulated walls
no end was in the outer half of what is searched. The median of so many cells of speckle is known
to 1.5 dB, a tenth of it to far less than what the level falls by at an end. [cells]"""
CELLS_OF_STEP = 3.0
"""Distance to either side of an end over which mean levels differ most: speckle in so many leaves
their mean a deviation of 3 dB, and walls end by tens of decibels. [cells]"""
LEAST_LIT = 0.3
"""Share of the places between a wall's first and last bright ones that are bright. Of the speckle
of a wall C times as bright as its background, exp(−1/√C) is above the halfway level: 0.73 at
C = 10; of a few unconnected glints little is. [-]"""
END_LEVEL = 0.1
"""Intensity over the wall's local mean that still is wall: speckle falls below it in one cell
of ten, and the tapered main lobe reaches it 0.8 cells beyond an end. [-]"""
WALL_LEVEL = 3.0
"""Level over what is beside it of the faintest wall that is followed to its ends: parts 2.2 dB over
the background are kept. With 10, of faint walls the brightest part alone was left, and stood out as
a wall of its own; with 3 as with 10 the end of a wall at 0 dB of SNR, which had been found 20 cells
too far, was found within 2 (judging room 356 of ``plain``). [-]"""
STEPS_OUT = 2
"""Lengths :data:`CELLS_OF_STEP` before the highest step in which the wall may already begin: a
minimum of the speckle may be a higher step. [-]"""


def lit_extent(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    reach: tuple[float, float],
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]] | None:
    """Follow the line both ways until more than :data:`GAP` cells are dark."""
    along = (end - start) / np.linalg.norm(end - start)
    middle = 0.5 * (start + end)
    step = cell_along(start, end, resolution) / SAMPLES_PER_CELL
    count = int(np.ceil(np.linalg.norm(end - start) / step)) + 1
    more = count  # as far again on either side
    places = (np.arange(-more, count + more) - (count - 1) / 2) * step
    points = middle + places[:, None] * along
    distance = np.linalg.norm(points, axis=-1)
    inside = (distance > reach[0]) & (distance < reach[1]) & (points[:, 1] > 0)
    places, points = places[inside], points[inside]
    intensity = np.abs(focus(points)) ** 2
    within = np.abs(places) <= np.linalg.norm(end - start) / 2
    if not within.any():
        return None
    level = mean_background(intensity[within])
    background = levels(focus, start, end, resolution)[1]
    # Halfway in decibels: the level of a wall varies by tens of them, above all with range.
    halfway = np.sqrt(level * background)
    occupied = np.nonzero(intensity > halfway)[0]
    if level < background or len(occupied) == 0:
        return None
    runs = np.split(occupied, np.nonzero(np.diff(occupied) > GAP * SAMPLES_PER_CELL)[0] + 1)
    run = max(runs, key=len)
    if len(run) < 2 or len(run) < LEAST_LIT * (run[-1] - run[0] + 1):
        return None
    level_db = 10 * np.log10(np.maximum(intensity, halfway))
    outermost = len(places) - 1
    first = end_of(level_db, int(run[0]))
    last = outermost - end_of(level_db[::-1], outermost - int(run[-1]))
    beside = np.maximum(background, _local_background(focus, points, along, resolution))
    first, last = likeliest_part(intensity / beside, first, last)
    if last - first < 2:
        return None
    return middle + places[first] * along, middle + places[last] * along


def likeliest_part(over: Float[np.ndarray, " places"], first: int, last: int) -> tuple[int, int]:
    r"""Return the first and the last place of the part of a line that is likeliest wall.

    Places of a wall that is m times as bright as what is beside it, and of what is beside it, are
    exponential variables; the sum of the logarithms of their likelihood ratio,

    .. math:: \frac{I}{b}\Bigl(1 - \frac1m\Bigr) - \ln m ,

    over a part of the line is largest between the wall's ends (Page 1954, doi:10.2307/2333009). In
    noise, or in the lobes of something bright, a line is followed from one bright place to the
    next, tens of cells beyond its wall.

    Parameters
    ----------
    over
        Intensity along the line over that beside it, I/b. [-]
    first, last
        The part to be searched.
    """
    gains = over[first : last + 1] * (1 - 1 / WALL_LEVEL) - np.log(WALL_LEVEL)
    begin, end = largest_sum(gains)
    return first + begin, first + end


def largest_sum(gains: Float[np.ndarray, " places"]) -> tuple[int, int]:
    """Return the first and the last place of the run whose gains have the largest sum."""
    sums = np.concatenate([[0.0], np.cumsum(gains)])
    # The lowest sum before each place, and where it is.
    lowest = np.minimum.accumulate(sums[:-1])
    last = int(np.argmax(sums[1:] - lowest))
    return int(np.argmin(sums[: last + 1])), last


def _local_background(
    focus: Focus,
    points: Float[np.ndarray, "places 3"],
    along: Float[np.ndarray, " 3"],
    resolution: Resolution,
) -> Float[np.ndarray, " places"]:
    """Return the mean intensity beside each place of a line, by its median there. [-]."""
    normal = np.array([along[1], -along[0], 0.0])
    away = resolution.cell(points, normal)[:, None, None] * normal
    offsets = BESIDE[BESIDE != 0.0]
    intensity = np.abs(focus(points[:, None] + offsets[:, None] * away)) ** 2
    window = round(CELLS_AT_END * SAMPLES_PER_CELL)
    usual = uniform_filter1d(np.median(intensity, axis=1), window, mode="nearest")
    return np.asarray(usual / np.log(2))


def end_of(level_db: Float[np.ndarray, " places"], rough: int) -> int:
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
    outer = max(0, step - STEPS_OUT * wide)
    return outer + int(np.argmax(np.append(level_db[outer:step] > enough, True)))


PLACES_PER_CELL = 4
"""Samples along a face: its end is found to a quarter of a cell. [-]"""
ASIDE = 0.75
"""Half width of the neighbourhood along the face whose brightest place counts: within a cell and a
half speckle has a maximum. [cells]"""
RANGE_SHIFTS = np.linspace(-0.5, 0.5, 3)
"""Ranges that are tried, about the line's: the line is known to half a cell there. [cells]"""


def face_ends(
    line: FittedLine, focus: Focus, resolution: Resolution, half: float
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Cut off a line that is seen over a mirror what is dim beside its ends.

    Parameters
    ----------
    line
        In the array's frame, its ends good to half a dozen cells and not short of the face's.
    focus
        Focuses the unweighted echo on points.
    resolution
        Of the echo.
    half
        Half the length of the array. [m]

    Returns
    -------
    The ends; the line's own where they are as bright as what is inside of them, or where no
    antenna sees the place in reflection, so that a dimmer level is no end of the face. [m]
    """
    cell = float(resolution.cell(line.middle, line.direction))
    count = max(3, round(PLACES_PER_CELL * line.length / cell))
    places = np.linspace(-0.5, 0.5, count) * line.length
    points = line.middle + places[:, None] * line.direction
    rays = points / np.linalg.norm(points, axis=-1, keepdims=True)
    shifts = RANGE_SHIFTS[:, None, None] * resolution.along_ray * rays
    brightest = (np.abs(focus(points + shifts)) ** 2).max(axis=0)
    level = maximum_filter1d(brightest, 2 * round(ASIDE * PLACES_PER_CELL) + 1, mode="nearest")
    first, last = _first_lit(level), count - 1 - _first_lit(level[::-1])
    start, end = line.start, line.end
    feet = np.sort((np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]]) - line.middle) @ line.direction)
    if first > 0 and feet[0] < places[first]:
        start = line.middle + (places[first] + ASIDE * cell) * line.direction
    if last < count - 1 and places[last] < feet[1]:
        end = line.middle + (places[last] - ASIDE * cell) * line.direction
    return start, end


def _first_lit(level: Float[np.ndarray, " places"]) -> int:
    """Return the first place as bright as the median of the cells that follow it."""
    near = round(CELLS_AT_END * PLACES_PER_CELL)
    inward = np.pad(level, (0, near - 1), mode="edge")
    inside = np.median(sliding_window_view(inward, near), axis=1)[: len(level) // 2]
    lit = level[: len(inside)] > END_LEVEL / np.log(2) * inside
    return int(np.argmax(np.append(lit, True)))
