"""What the image shows on a straight way, and whether something blocks it.

A user that is seen over a mirror, at the level of free space, is isotropic; so its straight way,
which is shorter, is blocked.
"""

from collections.abc import Mapping
from typing import Literal

import numpy as np
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.bearing import Bearing
from estimator.geometry.flat_wall import FlatWall
from estimator.positioning.level_likelihood import BLOCKED
from estimator.positioning.map_context import MapContext
from estimator.positioning.unseen_mirrors import wall_between

Sight = Literal[
    "clear", "clear aside", "not shown", "between ends", "behind a point", "something on it"
]
"""What the image shows on a straight way: nothing, within the angles without grating lobes or
beyond; or it does not show it; two points that may be a mirror's ends; a point before it that may
be the near end of a mirror seen edge-on; a point on it."""

WITH_A_MIRROR: Mapping[Sight, float] = {
    "clear": 1 / 8,
    "clear aside": 1 / 3,
    "not shown": 1.0,
    "between ends": 2.5,
    "behind a point": 1.0,
    "something on it": 10.0,
}
"""How much likelier the image shows that where an unseen mirror is than where none is. Two points
are about the straight way of 6 of 22 direct paths of tuning rooms, by chance. [-]"""

LOOSE_PEAKS = 12
"""Strongest peaks on no wall between which an unseen wall is suspected: 66 pairs. [-]"""
BESIDE = 2.0
"""Distance beside a ray within which a peak is on it, as for a line
(:data:`estimator.walls.line_relations.BESIDE`). [cells]"""
USER_SIZE = 0.05
"""Distance before the end of a path within which the user's own body may echo: a handset. What is
larger leaves the answer ambiguous. With half and twice of it the answers in ten rooms are the same
(``python -m validation.experiments.thresholds decisions``). [m]"""
BLOCKED_BY_UNKNOWN = 0.05
"""Probability that something that is not in the map blocks the straight way to a user whom a mirror
shows, before a look at the image: a quarter of
:data:`estimator.positioning.level_likelihood.BLOCKED`, since most of what blocks are walls that are
found. [-]"""
LEAST_IMAGE_CONTRAST = 300.0
"""Intensity of the brightest in an image over its background, below which walls may be there that
it does not show. As the noise in the echo of a wall of 0.01 mm rms was raised (36 draws), the wall
was found in all images with more than 85, in some of those with 40 to 85 and in none with less; the
rest is margin for walls that are farther or smoother. [-]"""


def hides_walls(contrast: float) -> bool:
    """Tell whether an image without walls has too little contrast to exclude a wall.

    Parameters
    ----------
    contrast
        Intensity of the brightest in the image over its background. [-]
    """
    return contrast < LEAST_IMAGE_CONTRAST


def unseen_mirrors(
    heading: Float[np.ndarray, " 3"],
    path_length: float,
    unassigned_peaks: Float[np.ndarray, "peaks 3"],
    resolution: Resolution,
    how: Bearing,
) -> list[tuple[FlatWall, Float[np.ndarray, "2 3"]]]:
    """Return the walls between two peaks on no wall that the ray meets before its end, and those.

    Parameters
    ----------
    heading, path_length
        Of the ray from the origin. [-], [m]
    unassigned_peaks
        The strongest peaks of the image that lie on no wall. [m]
    resolution
        Of the image: the peaks are known to a part of a cell, and so is the wall.
    how
        What the array measures of a direction.
    """
    points = unassigned_peaks
    met: list[tuple[FlatWall, Float[np.ndarray, "2 3"]]] = []
    for first, second in zip(*np.triu_indices(len(points), k=1), strict=True):
        wall = wall_between(points[first], points[second], resolution, how)
        hit = None if wall is None else wall.hit(np.zeros(3), heading)
        if wall is not None and hit is not None and hit[0] < path_length:
            met.append((wall, points[[first, second]]))
    return met


def chance_of_blockage(place: Float[np.ndarray, " 3"], room: MapContext, how: Bearing) -> float:
    """Return the probability that something blocks the straight way to a user. [-].

    The user is seen over a mirror, so the straight way, which is shorter, must be blocked or the
    user's beam aimed elsewhere. The image shows what there is on that way as well.

    Parameters
    ----------
    place
        Where the user is over the mirror. [m]
    room, how
        What the image shows, and what the array measures of a direction.
    """
    far = float(np.linalg.norm(place))
    heading = place / far
    for wall in room.walls:
        hit = wall.hit(np.zeros(3), heading)
        if hit is not None and hit[0] < far - USER_SIZE:
            return 1.0
    if not room.shows(heading) or far > room.reach or hides_walls(room.contrast):
        return BLOCKED
    loose = room.unassigned_peaks
    sight: Sight = "clear"
    if what_stands_in_the_way(heading, far, loose, room.resolution.across_ray) is not None:
        sight = "something on it"
    elif unseen_mirrors(heading, far, loose[:LOOSE_PEAKS], room.resolution, how):
        sight = "between ends"
    odds = BLOCKED_BY_UNKNOWN / (1 - BLOCKED_BY_UNKNOWN) * WITH_A_MIRROR[sight]
    return odds / (1 + odds)


def what_stands_in_the_way(
    heading: Float[np.ndarray, " 3"],
    path_length: float,
    unassigned_peaks: Float[np.ndarray, "peaks 3"],
    cell: float,
) -> Float[np.ndarray, " 3"] | None:
    """Return the strongest peak on no wall that is on the ray before its end, if there is one.

    Parameters
    ----------
    heading, path_length
        Of the ray from the origin. [-], [m]
    unassigned_peaks
        Peaks of the image that lie on no wall, strongest first. [m]
    cell
        Resolution of the image across a ray, as an angle. [rad]
    """
    if not len(unassigned_peaks):
        return None
    ahead = unassigned_peaks @ heading
    beside = np.linalg.norm(unassigned_peaks - ahead[:, None] * heading, axis=-1)
    on_it = (ahead > 0) & (ahead < path_length - USER_SIZE) & (beside < BESIDE * cell * ahead)
    return unassigned_peaks[int(np.argmax(on_it))] if on_it.any() else None
