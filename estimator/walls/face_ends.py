"""Where a flat face that is seen over a mirror ends, and its shoulder begins.

Only the ends of the array see the ends of a flat face reflect: a taper over the array, which takes
the sidelobes off a wall's ends, dims those of a face until they are no brighter than the shoulder
of what is scattered twice beside them. Without the taper a face is as bright at its ends as in its
middle, so these are where that level is left.
"""

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import maximum_filter1d

from estimator.walls.line_detection import Resolution
from estimator.walls.line_extent import CELLS_AT_END, END_LEVEL
from estimator.walls.line_fit_image import FittedLine
from estimator.walls.line_sampling import Focus

PLACES_PER_CELL = 4
ASIDE = 0.75
"""Cells along the face to either side of which each place is as bright as the brightest. [cells]"""
RANGE_SHIFTS = np.linspace(-0.5, 0.5, 3)
"""Ranges that are tried, about the line's. [cells]"""


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
