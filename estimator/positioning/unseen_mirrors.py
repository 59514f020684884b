r"""Walls too smooth to be seen, of which the image shows no more than two edges.

An edge echoes from where it is met at a right angle: from the foot of the perpendicular that the
array drops onto it. Two parallel edges at feet :math:`e_1, e_2` therefore run along
:math:`e_1 \times e_2`, and the two feet alone give the wall between them. In the plane of a linear
array all edges stand upright, and this is the segment between its two ends.
"""

import numpy as np
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.bearing import Bearing
from estimator.geometry.bearing_2d import LinearBearing
from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.wall_2d import Wall, unit_normal
from estimator.geometry.wall_3d import PlaneWall

PEAK_DEVIATION = 0.5
"""Of an end's peak along a wall's normal: pixels are 0.75 cells apart, and waves bent by an edge
come from beside it. [cells]"""
EDGE_REACH = 1.0
"""How far edges go on beyond the feet, to either side, over the distance between them: a wall up to
twice as high as wide, or as wide as high. [-]"""
EDGE_ON_LENGTH = 0.3
"""Length of a wall that is seen edge-on, of which the near end alone shows: the longest of the
random rooms. [m]"""
EDGE_ON_TILT = 0.15
"""Standard deviation of its direction about the line of sight: a wall turned farther shows the echo
of its face or of its far end, which then is 45 mm beside the ray. With half and twice of it the
answers in ten rooms are the same (``python -m validation.experiments.thresholds decisions``).
[rad]"""
STRAIGHT = 0.25
"""Sine of the angle from upright or level up to which two edges may be those of a wall beyond the
first mirror: 14°, what a cell of either foot turns a wall of 0.2 m by at 1 m and 60 GHz. Two points
at random have edges that lean farther in two of three cases, and a post and a sidelobe of a wall
left a plain user open. [-]"""
IN_LINE = 1e-6
"""Sine of the angle between two feet, seen from the array, below which nothing is between. [-]"""


def wall_between(
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    resolution: Resolution,
    how: Bearing,
) -> FlatWall | None:
    """Return the wall between two edges, with the covariance of their pixels.

    Parameters
    ----------
    start, end
        Where the image shows the edges. [m]
    resolution
        Of the image: the peaks are known to a part of a cell, and so is the wall.
    how
        What the array measures of a direction: whether all is upright.

    Returns
    -------
    The wall; ``None`` if both are in one direction, so that no ray passes between them.
    """
    length = float(np.linalg.norm(end - start))
    ends = np.stack([start, end])
    if isinstance(how, LinearBearing):
        variances = (PEAK_DEVIATION * resolution.cell(ends, unit_normal(start, end))) ** 2
        # The end moving along the normal by δ turns the line by −δ over its length, the start
        # by δ.
        changes = np.array([[1 / length, -1 / length], [0.5, 0.5]])
        return Wall(start=start, end=end, covariance=changes * variances @ changes.T)
    upright = np.cross(start, end)
    size = float(np.linalg.norm(upright))
    if size < IN_LINE * float(np.linalg.norm(start) * np.linalg.norm(end)):
        return None
    axes = np.stack([(end - start) / length, upright / size])
    normal = np.cross(axes[0], axes[1])
    middle = 0.5 * (start + end)
    reach = EDGE_REACH * length
    corners = np.array([[-0.5 * length, -reach], [0.5 * length, -reach],
                        [0.5 * length, reach], [-0.5 * length, reach]])  # fmt: skip
    changes = np.array([[-1 / length, 1 / length], [0.5, 0.5]])
    variances = (PEAK_DEVIATION * resolution.cell(ends, normal)) ** 2
    # An edge is at right angles to its foot: a foot that errs along it turns it as much.
    aside = PEAK_DEVIATION * resolution.cell(ends, axes[1]) / np.linalg.norm(ends, axis=1)
    covariance = np.zeros((3, 3))
    covariance[np.ix_([0, 2], [0, 2])] = changes * variances @ changes.T
    covariance[1, 1] = float((aside**2).mean()) / 2
    return PlaneWall(
        corners=middle + corners @ axes, centre=middle, axes=axes, covariance=covariance
    )


def stands_straight(wall: FlatWall) -> bool:
    """Tell whether the edges of a wall between two points are upright or level, as most are."""
    if not isinstance(wall, PlaneWall):
        return True
    upright = abs(float(wall.axes[1, 2]))
    return min(upright, float(np.sqrt(max(1 - upright**2, 0.0)))) < STRAIGHT


def wall_behind(point: Float[np.ndarray, " 3"], resolution: Resolution) -> Wall:
    """Return the upright wall that runs away from the array behind its near end.

    In the plane only: in space one foot does not tell how its edge runs, nor so the wall.

    Parameters
    ----------
    point
        Where the image shows the near end. [m]
    resolution
        Of the image.
    """
    end = point * (1 + EDGE_ON_LENGTH / float(np.linalg.norm(point)))
    offset = PEAK_DEVIATION * float(resolution.cell(point, unit_normal(point, end)))
    # It turns about its near end; its middle moves against the normal then, as in wall_between.
    turn = np.array([1.0, -0.5 * EDGE_ON_LENGTH]) * EDGE_ON_TILT
    covariance = np.outer(turn, turn) + np.diag([0.0, offset**2])
    return Wall(start=point, end=end, covariance=covariance)
