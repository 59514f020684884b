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
from estimator.walls.fitted_line import FittedLine

FACETS = 48
"""Places along a wall over which a cloud's ways are tried, the straight way included: their
pairs fill the cloud. Of the points in clouds of four times as many, 1.1 % are left out (``python
-m validation.experiments.thresholds limits``); the time grows with the square. [-]"""
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


def _polar(
    points: Float[np.ndarray, "points 3"],
) -> tuple[Float[np.ndarray, " points"], Float[np.ndarray, " points"]]:
    """Return the sine of the azimuth [-] and the range [m]."""
    reach = np.linalg.norm(points, axis=-1)
    return points[:, 0] / reach, reach
