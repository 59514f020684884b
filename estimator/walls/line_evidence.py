r"""Four tests on the echo whether a line of the image is a wall.

*Explained share*. The row's strengths are fitted to all range profiles by least squares, as in
:mod:`estimator.walls.line_fit_echo`. Echo and residual are then focused on cells along the line and
beside it. A wall leaves little there. A wave that was scattered twice, a line through unconnected
peaks, or an arc of sidelobes, is focused by no row: most of it stays beside the line. Echo from the
same ranges but other directions does not count.

*More than one range*. The sidelobes of a point that only a part of the array sees lie on an arc of
its range. A short line along an arc is told from it only by the reflection of the array.

*Curvature*. Waves that were scattered twice are more curved than those of a wall there.

*Unambiguous range*. The arc of a wave from beyond it is focused as from there.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve

from estimator.array.resolution_cell import Resolution
from estimator.array.windows import SURVEY_TAPER, aperture_taper
from estimator.imaging.phase_curvature import bent_intensities
from estimator.imaging.range_alias import ARC, brightest_from_beyond
from estimator.imaging.range_compression import RangeProfiles
from estimator.imaging.survey_2d import STEP, Survey
from estimator.measurement.model import Echo
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_sampling import trial_points
from estimator.walls.scatterer_row import (
    adjoint,
    every_nth,
    factorized,
    row_echoes,
    row_places,
    row_profiles,
)

MOST_CELLS = 40.0
"""Longest part of a line that is explained: its cost grows as the fourth power. [cells]"""
MOST_POSITIONS = 128
"""Most antenna positions of which it is explained. [-]"""
ASIDE = np.arange(-4.0, 5.0)
"""Places across the line at which echo and residual are compared. [cells]"""
BEYOND = 4.0
"""How far the row goes on beyond the line's ends, which are found to a few cells. [cells]"""

FEWEST_BENT, MOST_BENT_PLACES = 8, 64
"""Places of a line, one for each cell, of which the curvature is taken together. [-]"""


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What the echo says of a line."""

    explained: float  # share of a cell's echo, on the line and beside it, by the row: median [-]
    depth: float  # extent in range [cells]


def examine(echo: Echo, line: FittedLine, resolution: Resolution) -> Evidence:
    """Examine a line of the image.

    Parameters
    ----------
    echo
        In the array's frame, of uniform frequencies.
    line
        As fitted to the image.
    resolution
        Of the echo.
    """
    return Evidence(explained=_explained(echo, line, resolution), depth=depth_of(line, resolution))


def depth_of(line: FittedLine, resolution: Resolution) -> float:
    """Return a line's extent in range. [cells]."""
    ranges = np.linalg.norm([line.start, line.end, _nearest_place(line)], axis=-1)
    return float(np.ptp(ranges)) / resolution.along_ray


def gain_by_bending(profiles: RangeProfiles, line: FittedLine, resolution: Resolution) -> float:
    """Return the intensity that one excess curvature adds to most places of a line. [-].

    What was scattered twice, by a post and a rough wall or by two walls, lies on lines as well; but
    its waves are more curved than those of things there, and all alike. A single peak of speckle
    may be so by chance.

    Parameters
    ----------
    profiles
        Of the echo, not tapered.
    line
        As fitted to the image.
    resolution
        Of the echo.

    Returns
    -------
    Median, over the places, of the intensity with the best curvature over that with a point's: 1 at
    least. Sidelobes of something bright beside a wall are bent at some of its places.
    """
    cells = line.length / float(resolution.cell(line.middle, line.direction))
    count = int(np.clip(cells, FEWEST_BENT, MOST_BENT_PLACES))
    places = (np.arange(count) + 0.5) / count
    points = line.start + places[:, None] * (line.end - line.start)
    tried = bent_intensities(profiles, points, resolution)
    return float(np.median(tried / tried[:, :1], axis=0).max())


def _nearest_place(line: FittedLine) -> Float[np.ndarray, " 3"]:
    """Return the place of a line that is nearest to the array's centre. [m]."""
    along = -float(line.middle @ line.direction)
    half = 0.5 * line.length
    place: np.ndarray = line.middle + float(np.clip(along, -half, half)) * line.direction
    return place


def _explained(echo: Echo, line: FittedLine, resolution: Resolution) -> float:
    """Return the share of the echo on a line and beside it that a row on the line explains. [-]."""
    cell = float(resolution.cell(line.middle, line.direction))
    half = 0.5 * min(line.length, MOST_CELLS * cell) * line.direction
    start, end = line.middle - half, line.middle + half
    every = max(1, int(np.ceil(len(echo.positions) / MOST_POSITIONS)))
    few = every_nth(echo, every)
    places = row_places(few, start, end, (BEYOND * cell, BEYOND * cell))
    row = line.middle + places[:, None] * line.direction
    profiles = row_profiles(few, start, end)
    data = profiles.values.ravel()
    echoes = row_echoes(few, profiles, row)
    left = data - echoes @ cho_solve(factorized(echoes), adjoint(echoes, data))
    count = max(1, round(2 * float(np.linalg.norm(half)) / cell))
    along = ((np.arange(count) + 0.5) / count - 0.5) * 2 * float(np.linalg.norm(half))
    across = ASIDE * float(resolution.cell(line.middle, line.normal))
    cells = trial_points(start, end, along, np.zeros(1), across)[0].reshape(-1, 3)
    focused = row_echoes(few, profiles, cells)
    shares = []
    for taper in (np.ones(len(few.positions)), aperture_taper(few.positions, SURVEY_TAPER)):
        seen, unexplained = (
            (np.abs(adjoint(focused, (taper[:, None] * values).ravel())) ** 2)
            .reshape(across.size, -1)
            .sum(axis=0)
            for values in (data.reshape(profiles.values.shape), left.reshape(profiles.values.shape))
        )
        shares.append(float(np.median(1 - unexplained / seen)))
    return max(shares)


def is_from_beyond(
    line: FittedLine, looked: Survey, profiles: RangeProfiles, resolution: Resolution
) -> bool:
    """Tell whether a line is the arc of one wave from beyond the unambiguous range.

    Parameters
    ----------
    line
        In the array's frame.
    looked
        The survey, whose directions are tried.
    profiles
        Of the echo, not tapered.
    resolution
        Of the echo.
    """
    reach = [float(np.linalg.norm(place)) for place in (line.start, line.middle, line.end)]
    ranges = np.arange(min(reach), max(reach), STEP * resolution.along_ray)
    sines = looked.points[0, :, 0] / np.linalg.norm(looked.points[0], axis=-1)
    return brightest_from_beyond(profiles, ranges, sines) > ARC
