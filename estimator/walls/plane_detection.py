"""Planes among the peaks of a 3-D image: a first guess of the walls.

RANSAC: planes through three peaks are drawn at random, and the one that most peaks lie on is kept
if peaks strewn at random would hardly put as many on any plane. As for lines
(:mod:`estimator.walls.line_detection`), every peak counts the same, however bright: speckle shows
peaks of random strength all over a rough wall.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from estimator import false_alarm
from estimator.array.resolution_cell import Resolution
from estimator.compute.distributions import poisson_tail

DRAWS = 6000
"""Planes drawn in each round: one that a tenth of the peaks lie on is drawn six times. [-]"""

FEWEST_INLIERS = 12
"""Peaks that make a plane, besides what chance demands. [-]"""

TOLERANCE = 0.75
"""Distance of a peak from its plane: the peak is known to half a pixel of 0.49 cells, and a plane
through three such peaks is off by as much again where the others are. [cells]"""

SKIRT = 2.0
"""Distance from its plane, over :data:`TOLERANCE`, within which peaks beside a wall are its
sidelobes: together 1.5 cells; the survey's main lobe ends at 1.4. [-]"""

CLUMPED = 4.0
"""Density of the peaks of furniture over that of peaks strewn evenly over the volume, which the
chance of a plane is computed for. Of 100 volumes of evenly strewn peaks none shows a plane. [-]"""

GAP = 6.0
"""Distance between peaks beyond which a wall ends: in two dimensions speckle leaves narrower gaps
than along a line (:data:`estimator.walls.line_detection.GAP`). [cells]"""

LEAST_SPAN = 4.0
"""Side of the smallest square whose area three peaks must span to be tried as a plane: errors of
half a cell turn a smaller one by more than 10°. [cells]"""

MOST_REFUSED = 3
"""Planes in turn whose largest patch has too few peaks, after which the search ends: they are
what chance lines up across the room. [-]"""

REFITS = 3
"""Fits of the plane to the peaks near it, each with what the fit before it gained. [-]"""


@dataclass(frozen=True, kw_only=True)
class PlaneCandidate:
    """A plane that many peaks lie on."""

    centre: Float[np.ndarray, " 3"]  # [m]
    normal: Float[np.ndarray, " 3"]  # unit vector
    members: Float[np.ndarray, "members 3"]  # the peaks [m]


def find_planes(
    peaks: Float[np.ndarray, "peaks 3"], resolution: Resolution, *, depth: float, width: float
) -> tuple[PlaneCandidate, ...]:
    """Find planes by consensus over triples of peaks; the one with most peaks first.

    Parameters
    ----------
    peaks
        In the frame of an array at the origin. [m]
    resolution
        Of the image that the peaks come from.
    depth
        Length of the surveyed volume along the range, in which chance would strew peaks. [m]
    width
        Its width across, as an angle. [rad]

    Returns
    -------
    Planes; none uses another's peaks.
    """
    found: list[PlaneCandidate] = []
    unassigned, refused = peaks, 0
    # The same peaks give the same planes: the draws are a part of the search, not of chance.
    rng = np.random.default_rng(0)
    while len(unassigned) >= FEWEST_INLIERS and refused < MOST_REFUSED:
        members = _best_plane(unassigned, resolution, (depth, width), rng)
        if members is None:
            break
        members = _largest_patch(unassigned, members, resolution)
        chosen = unassigned[members]
        if len(chosen) < FEWEST_INLIERS:
            refused += 1
            unassigned = unassigned[~members]
            continue
        centre, normal = _fitted(chosen)
        found.append(PlaneCandidate(centre=centre, normal=normal, members=chosen))
        near = _near(unassigned, centre[None], normal[None], resolution, SKIRT * TOLERANCE)[0]
        unassigned = unassigned[~(members | (near & _beside(unassigned, chosen, resolution)))]
    return tuple(found)


def _best_plane(
    peaks: Float[np.ndarray, "peaks 3"],
    resolution: Resolution,
    volume: tuple[float, float],
    rng: np.random.Generator,
) -> Bool[np.ndarray, " peaks"] | None:
    triples = rng.integers(len(peaks), size=(DRAWS, 3))
    first, second, third = (peaks[triples[:, i]] for i in range(3))
    across = np.cross(second - first, third - first)
    area = np.linalg.norm(across, axis=1)
    cell = resolution.across_ray * np.linalg.norm(first, axis=1)
    wide = area > (LEAST_SPAN * cell) ** 2
    if not wide.any():
        return None
    near = _near(peaks, first[wide], across[wide] / area[wide, None], resolution, TOLERANCE)
    counts = near.sum(axis=1)
    best = int(np.argmax(counts))
    # Of peaks strewn at random the expected number, besides the three drawn, in the plane's slab.
    centre, normal = _fitted(peaks[near[best]])
    reach = float(np.linalg.norm(centre))
    radial = abs(float(normal @ centre)) / reach
    extent = radial * volume[0] + np.sqrt(1 - radial**2) * volume[1] * reach
    slab = 2 * TOLERANCE * float(resolution.cell(centre, normal))
    expected = CLUMPED * len(peaks) * slab / extent
    chance = poisson_tail(float(counts[best]) - 4, expected) * DRAWS
    if counts[best] < FEWEST_INLIERS or chance > false_alarm.PLANE:
        return None
    members = near[best]
    for _ in range(REFITS):  # the best of the drawn planes is still only one through three peaks
        centre, normal = _fitted(peaks[members])
        refined = _near(peaks, centre[None], normal[None], resolution, TOLERANCE)[0]
        if refined.sum() <= members.sum():
            break
        members = refined
    return np.asarray(members)


def _fitted(
    points: Float[np.ndarray, "points 3"],
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Fit a plane by total least squares: centre and unit normal."""
    centre = points.mean(axis=0)
    return centre, np.linalg.svd(points - centre, full_matrices=False)[2][2]


def _near(
    peaks: Float[np.ndarray, "peaks 3"],
    origins: Float[np.ndarray, "planes 3"],
    normals: Float[np.ndarray, "planes 3"],
    resolution: Resolution,
    tolerance: float,
) -> Bool[np.ndarray, "planes peaks"]:
    distance = np.einsum("lx,px->lp", normals, peaks)
    reach = np.linalg.norm(peaks, axis=1)
    radial = np.abs(distance) / reach
    crossing = np.sqrt(np.clip(1 - radial**2, 0.0, None))
    cell = 1 / np.hypot(radial / resolution.along_ray, crossing / (resolution.across_ray * reach))
    distance -= np.einsum("lx,lx->l", normals, origins)[:, None]
    near: np.ndarray = np.abs(distance) < tolerance * cell
    return near


def _largest_patch(
    peaks: Float[np.ndarray, "peaks 3"], members: Bool[np.ndarray, " peaks"], resolution: Resolution
) -> Bool[np.ndarray, " peaks"]:
    """Keep the members that hang together without a gap."""
    index = np.flatnonzero(members)
    chosen = peaks[index]
    cell = resolution.across_ray * float(np.median(np.linalg.norm(chosen, axis=1)))
    pairs = cKDTree(chosen).query_pairs(GAP * cell, output_type="ndarray")
    label = np.arange(len(chosen))
    while True:  # each point takes the smallest label among its neighbours
        new = label.copy()
        np.minimum.at(new, pairs[:, 0], label[pairs[:, 1]])
        np.minimum.at(new, pairs[:, 1], label[pairs[:, 0]])
        if np.array_equal(new, label):
            break
        label = new
    largest = np.bincount(label).argmax()
    kept = np.zeros(len(peaks), dtype=bool)
    kept[index[label == largest]] = True
    return kept


def _beside(
    peaks: Float[np.ndarray, "peaks 3"],
    members: Float[np.ndarray, "members 3"],
    resolution: Resolution,
) -> Bool[np.ndarray, " peaks"]:
    """Tell which peaks are within a gap of a plane's members: its skirt of sidelobes."""
    distance = cKDTree(members).query(peaks)[0]
    beside: np.ndarray = distance < GAP * resolution.across_ray * np.linalg.norm(peaks, axis=1)
    return beside
