r"""Where the diffuse echoes of a target over rough mirrors appear: the cloud around its ghost.

Out over one facet or mirror and back over another, the echo of a target whose image is t has
the length of

.. math:: \lVert f_1 \rVert + \lVert f_1 - t \rVert + \lVert t - f_2 \rVert + \lVert f_2 \rVert

for facets f on the wall (mirroring keeps distances to the wall), and appears at half of it, at the
mean of the two directions' sines. A facet on the straight line to t stands for the specular way.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_2d import crossing, mirrored
from estimator.walls.fitted_line import FittedLine

FACETS = 48
"""Places along a wall over which a cloud's ways are tried, the straight way included: their
pairs fill the cloud. Of the points in clouds of four times as many, 1.1 % are left out (``python
-m validation.experiments.thresholds limits``); the time grows with the square. [-]"""
FAINTER = 4.0
"""Most intensity of a line over that of the point which makes it of a wall: where the wall
reflects, both ways round come back together, each as strong as the point itself. [-]"""
MOST = 0.5
"""Share of a line from which most of it is meant. [-]"""
MARGIN = 2.0
"""Range before and behind a cloud, and distance from a mixed echo in range and sine, within which a
point counts to it: the survey's main lobe ends at 1.4, and both are off by half a cell. [cells]"""


def in_cloud(
    points: Float[np.ndarray, "points 3"],
    ghost: Float[np.ndarray, " 3"],
    doors: Sequence[FittedLine],
    resolution: Resolution,
) -> Bool[np.ndarray, " points"]:
    """Tell which points of the image may be diffuse echoes of a target's image.

    Parameters
    ----------
    points
        Places in the raw image. [m]
    ghost
        Where the raw image shows the target. [m]
    doors
        Lines of the raw image through which it is seen; each may be rough.
    resolution
        Of the image.
    """
    inside = np.zeros(len(points), dtype=bool)
    sine, reach = _polar(points)
    for door in doors:
        facets = np.linspace(door.start, door.end, FACETS)
        facet_sine, distance = _polar(facets)
        length = distance + np.linalg.norm(facets - ghost, axis=-1)
        facet_sine, length = (
            np.append(array, straight)
            for array, straight in zip((facet_sine, length), _polar(ghost[None]), strict=True)
        )
        out, back = np.triu_indices(facet_sine.size)
        sines = 0.5 * (facet_sine[out] + facet_sine[back])
        ranges = 0.5 * (length[out] + length[back])
        beside = np.abs(sine[:, None] - sines) < resolution.across_ray
        margin = MARGIN * resolution.along_ray
        nearest = np.where(beside, ranges, np.inf).min(axis=1) - margin
        farthest = np.where(beside, ranges, -np.inf).max(axis=1) + margin
        inside |= (reach > nearest) & (reach < farthest)
    return inside


def between(
    points: Float[np.ndarray, "points 3"],
    first: Float[np.ndarray, " 3"],
    second: Float[np.ndarray, " 3"],
    resolution: Resolution,
) -> Bool[np.ndarray, " points"]:
    """Tell which points are what one way out and another way back make of two images of a target.

    Such an echo appears at the mean range and the mean sine of the two, but at neither.
    """
    sine, reach = _polar(points)
    sines, ranges = _polar(np.stack([first, second]))
    near: np.ndarray = (np.abs(sine - sines.mean()) < MARGIN * resolution.across_ray) & (
        np.abs(reach - ranges.mean()) < MARGIN * resolution.along_ray
    )
    return near


def without_scattered_twice(
    lines: Sequence[FittedLine],
    points: Float[np.ndarray, "points 3"],
    levels: Float[np.ndarray, " points"],
    resolution: Resolution,
) -> tuple[FittedLine, ...]:
    """Leave out lines that are a wall's echo by way of a bright point, or over another wall.

    What goes out to a point, on to a rough wall's facet and back from there (or the other way
    round) appears at half the way's length and at the mean sine of point and facet: a line, as
    sharp as the wall.

    What goes out to a wall's facet straight and comes back over a mirror (or the other way round)
    appears at the mean range and the mean sine of the facet and its image. The wall may be too
    steep to be seen itself, but for an end: then the line begins where that end appears so.

    Parameters
    ----------
    lines
        Of the image.
    points
        Its bright points that are on no line, and those beyond the imaged sector. [m]
    levels
        Their intensities. [-]
    resolution
        Of the image.
    """
    kept = []
    for line in lines:
        share = (np.arange(FACETS) + 0.5) / FACETS
        places = line.start + share[:, None] * (line.end - line.start)
        bright = points[FAINTER * levels > line.level]
        walls = [one for one in lines if one is not line]
        if not any(
            np.mean(_by_way_of(places, point, wall, resolution)) > MOST
            for wall in walls
            for point in bright
        ) and not any(_begins_over(line, points, wall, resolution) for wall in walls):
            kept.append(line)
    return tuple(kept)


def _by_way_of(
    places: Float[np.ndarray, "places 3"],
    point: Float[np.ndarray, " 3"],
    wall: FittedLine,
    resolution: Resolution,
) -> Bool[np.ndarray, " places"]:
    """Tell which places a wall's facets appear at by way of a point."""
    along = np.linspace(wall.start, wall.end, 2 * FACETS)
    sine, reach = _polar(along)
    (point_sine,), (distance,) = _polar(point[None])
    sines = 0.5 * (sine + point_sine)
    ranges = 0.5 * (reach + distance + np.linalg.norm(along - point, axis=-1))
    seen_sine, seen_reach = _polar(places)
    near = (np.abs(seen_sine[:, None] - sines) < MARGIN * resolution.across_ray) & (
        np.abs(seen_reach[:, None] - ranges) < MARGIN * resolution.along_ray
    )
    return np.asarray(near.any(axis=1))


def _begins_over(
    line: FittedLine,
    points: Float[np.ndarray, "points 3"],
    mirror: FittedLine,
    resolution: Resolution,
) -> bool:
    """Tell whether a line begins where a mirror makes a mixed echo of a bright point."""
    margin = MARGIN * float(resolution.cell(mirror.middle, mirror.direction))
    start, end = (
        mirror.start - margin * mirror.direction,
        mirror.end + margin * mirror.direction,
    )
    ends = np.stack([line.start, line.end])
    for point, image in zip(points, mirrored(points, mirror.start, mirror.end), strict=True):
        reach = float(np.linalg.norm(image))
        met = crossing(np.zeros(3), image / reach, start, end)
        if met is not None and met[0] < reach and between(ends, point, image, resolution).any():
            return True
    return False


def _polar(
    points: Float[np.ndarray, "points 3"],
) -> tuple[Float[np.ndarray, " points"], Float[np.ndarray, " points"]]:
    """Return the sine of the azimuth [-] and the range [m]."""
    reach = np.linalg.norm(points, axis=-1)
    return points[:, 0] / reach, reach
