"""Samples of an image along trial lines, and the brightness there and beside."""

import numpy as np
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_2d import unit_normal
from estimator.imaging.focusing import Focus
from estimator.imaging.peak_detection import mean_background

SAMPLES_PER_CELL = 2
"""Along the line. [-]"""
CELLS_CUT = 2.0
"""Cells left out at either end: the sidelobes of an end, which lean, would tilt the line. [cells]
"""
MOST_CUT = 0.5
"""Most that is left out of a short line, over its length. [-]"""
BESIDE = np.array([-12.0, -10.0, -8.0, -6.0, 0.0, 6.0, 8.0, 10.0, 12.0])
"""Parallel lines at which brightness is compared, the line itself in the middle: from 6 cells on
the taper's sidelobes of the line are below −60 dB. [cells]"""


def cell_along(
    start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], resolution: Resolution
) -> float:
    """Return the width of a resolution cell along a line, at its middle. [m]."""
    direction = (end - start) / np.linalg.norm(end - start)
    return float(resolution.cell(0.5 * (start + end), direction))


def cell_across(
    start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], resolution: Resolution
) -> float:
    """Return the width of a resolution cell across a line, at its middle. [m]."""
    return float(resolution.cell(0.5 * (start + end), unit_normal(start, end)))


def places_along(
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    per_cell: int = SAMPLES_PER_CELL,
) -> Float[np.ndarray, " places"]:
    """Sample a segment without its very ends, measured from its midpoint. [m]."""
    length = float(np.linalg.norm(end - start))
    cell = cell_along(start, end, resolution)
    length -= min(2 * CELLS_CUT * cell, MOST_CUT * length)
    count = max(2, round(per_cell * length / cell))
    places: np.ndarray = (np.arange(count) + 0.5) / count * length - length / 2
    return places


def trial_points(
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    places: Float[np.ndarray, " places"],
    tilts: Float[np.ndarray, " tilts"],
    offsets: Float[np.ndarray, " offsets"],
) -> Float[np.ndarray, "tilts offsets places 3"]:
    """Points of lines turned about the midpoint (counter-clockwise) and moved along the normal."""
    along = (end - start) / np.linalg.norm(end - start)
    normal = unit_normal(start, end)
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


def levels(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
) -> tuple[float, float]:
    """Mean intensity along the line, and the median-based one of lines beside it."""
    places = places_along(start, end, resolution)
    cell = cell_across(start, end, resolution)
    beside = cell * BESIDE
    points = trial_points(start, end, places, np.zeros(1), beside)[0]
    intensity = np.abs(focus(points)) ** 2
    on = len(beside) // 2
    around = np.delete(intensity, on, axis=0)
    return float(intensity[on].mean()), mean_background(around)


def median_level(
    focus: Focus,
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
) -> float:
    """Mean intensity along the line if speckle of one level has this median."""
    places = places_along(start, end, resolution)
    points = trial_points(start, end, places, np.zeros(1), np.zeros(1))[0, 0]
    return mean_background(np.abs(focus(points)) ** 2)
