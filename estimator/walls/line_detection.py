"""Straight lines among the peaks of a SAR image: a first guess of the mirrors.

A rough wall shows as speckle: one peak for each resolution cell or two along it (1.8 are measured),
of random strength. Every peak therefore counts the same here, however bright; a consensus over
pairs of peaks (as in RANSAC, but over all pairs) then finds lines that a few bright facets, edges
or point targets cannot imitate.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from estimator.array.resolution_cell import Resolution
from estimator.imaging.peak_detection import MOST_PEAKS

FEWEST_INLIERS = 5
"""Peaks that make a line, without a :data:`GAP`. Of 400 peaks strewn over an image of 128 elements
and 75 GHz no five made one in 6 images, but four made two in three of these. [-]"""

TOLERANCE = 0.5
"""Distance across a line within which a peak is on it: a pixel of the survey is 0.49 cells. [cells]
"""

LEAST_APART = 3.0
"""Distance of two peaks that are tried as a line: of closer ones, each known to half a cell, the
direction is not known to 10°. [cells]"""

SKIRT = 2.0
"""Distance across a line that was found within which peaks are its sidelobes: the survey's main
lobe ends at 1.4, and a candidate is off by half a cell. [cells]"""

BEYOND_END = 3.0
"""Distance beyond the ends of a line that was found within which peaks are its sidelobes, or its
speckle once more. [cells]"""

PAIRS_AT_ONCE = 4_000_000
"""Distances between lines and peaks that are held at once: 32 MB. [-]"""

GAP = 7.0
"""Cells without a peak that end a wall; speckle alone leaves so wide a gap with a
probability below 1e-3 for each cell. [cells]"""


@dataclass(frozen=True, kw_only=True)
class LineCandidate:
    """A segment that many peaks lie on."""

    start: Float[np.ndarray, " 3"]  # [m]
    end: Float[np.ndarray, " 3"]  # [m]
    inliers: int


def find_lines(
    peaks: Float[np.ndarray, "peaks 3"], resolution: Resolution, *, most: int = MOST_PEAKS
) -> tuple[LineCandidate, ...]:
    """Find segments by consensus over all pairs of peaks; the one with most peaks first.

    Parameters
    ----------
    peaks
        Points at z = 0, in the frame of an array at the origin. [m]
    resolution
        Of the image that the peaks come from.
    most
        Where to stop.

    Returns
    -------
    Segments, each with at least :data:`FEWEST_INLIERS` peaks; none uses another's peaks.
    """
    found: list[LineCandidate] = []
    unassigned = peaks
    while len(unassigned) >= FEWEST_INLIERS and len(found) < most:
        candidate, members = _best_line(unassigned, resolution)
        if candidate is None:
            break
        found.append(candidate)
        # The line's own peaks go, and the skirt of sidelobes beside it.
        unassigned = unassigned[
            ~(members | on_segment(unassigned, candidate, resolution, tolerance=SKIRT))
        ]
    return tuple(found)


def _best_line(
    peaks: Float[np.ndarray, "peaks 3"], resolution: Resolution
) -> tuple[LineCandidate | None, Bool[np.ndarray, " peaks"]]:
    first, second = np.triu_indices(len(peaks), k=1)
    along = peaks[second] - peaks[first]
    length = np.linalg.norm(along, axis=-1)
    cells = resolution.along_ray + resolution.across_ray * np.linalg.norm(peaks[first], axis=-1)
    apart = length > LEAST_APART * cells
    first, along, length = first[apart], along[apart], length[apart]
    best: tuple[int, np.ndarray] | None = None
    for pairs in np.array_split(
        np.arange(len(first)), max(1, len(first) * len(peaks) // PAIRS_AT_ONCE)
    ):
        directions = along[pairs] / length[pairs, None]
        near = _near_lines(peaks, peaks[first[pairs]], directions, resolution)
        counts = near.sum(axis=1)
        top = int(np.argmax(counts)) if len(counts) else 0
        if len(counts) and (best is None or counts[top] > best[0]):
            best = int(counts[top]), near[top]
    nobody = np.zeros(len(peaks), dtype=bool)
    if best is None or best[0] < FEWEST_INLIERS:
        return None, nobody
    return _longest_run(peaks, best[1], resolution)


def _near_lines(
    peaks: Float[np.ndarray, "peaks 3"],
    origins: Float[np.ndarray, "lines 3"],
    directions: Float[np.ndarray, "lines 3"],
    resolution: Resolution,
    tolerance: float = TOLERANCE,
) -> Bool[np.ndarray, "lines peaks"]:
    normals = np.stack([directions[:, 1], -directions[:, 0]], axis=-1)
    plane = peaks[:, :2]
    distance = normals @ plane.T - np.einsum("lx,lx->l", normals, origins[:, :2])[:, None]
    reach = np.linalg.norm(plane, axis=-1)
    radial = np.abs(normals @ plane.T) / reach
    crossing = np.sqrt(np.clip(1 - radial**2, 0.0, None))
    cell = 1 / np.hypot(radial / resolution.along_ray, crossing / (resolution.across_ray * reach))
    near: np.ndarray = np.abs(distance) < tolerance * cell
    return near


def _longest_run(
    peaks: Float[np.ndarray, "peaks 3"], members: Bool[np.ndarray, " peaks"], resolution: Resolution
) -> tuple[LineCandidate | None, Bool[np.ndarray, " peaks"]]:
    """Fit a line to the members by total least squares and keep their longest run."""
    chosen = peaks[members]
    centre = chosen.mean(axis=0)
    direction = np.linalg.svd(chosen - centre)[2][0]
    places = (chosen - centre) @ direction
    order = np.argsort(places)
    gaps = np.diff(places[order]) / resolution.cell(chosen[order[1:]], direction)
    runs = np.split(order, np.nonzero(gaps > GAP)[0] + 1)
    run = max(runs, key=len)
    used = np.zeros(len(peaks), dtype=bool)
    used[np.nonzero(members)[0][run]] = True
    if len(run) < FEWEST_INLIERS:
        return None, used
    ends = centre + places[run[[0, -1]], None] * direction
    return LineCandidate(start=ends[0], end=ends[1], inliers=len(run)), used


def on_segment(
    peaks: Float[np.ndarray, "peaks 3"],
    line: LineCandidate,
    resolution: Resolution,
    *,
    tolerance: float,
) -> Bool[np.ndarray, " peaks"]:
    """Tell which peaks lie on a segment, or up to :data:`BEYOND_END` beyond its ends.

    Parameters
    ----------
    peaks
        In the array's frame. [m]
    line
        The segment.
    resolution
        Of the image.
    tolerance
        Distance across the line that still counts. [cells]
    """
    along = line.end - line.start
    length = float(np.linalg.norm(along))
    direction = along / length
    # Most of an image's pixels are farther away than any cell is wide.
    farthest = float(np.sqrt(np.einsum("px,px->p", peaks, peaks).max(initial=0.0)))
    widest = tolerance * max(resolution.along_ray, resolution.across_ray * farthest)
    across = peaks[:, :2] @ [direction[1], -direction[0]]
    across -= line.start[0] * direction[1] - line.start[1] * direction[0]
    near = np.flatnonzero(np.abs(across) <= 1.001 * widest)
    some = peaks[near]
    places = (some - line.start) @ direction
    margin = BEYOND_END * resolution.cell(some, direction)
    beside = _near_lines(some, line.start[None], direction[None], resolution, tolerance)[0]
    members = np.zeros(len(peaks), dtype=bool)
    members[near] = beside & (places > -margin) & (places < length + margin)
    return members
