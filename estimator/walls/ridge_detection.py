"""Straight ridges of a SAR image: a second guess of the mirrors, where peaks are too few.

A wall that nearly faces the array, a short one, or one that is cut by the border of the imaged
sector has a handful of peaks: too few for a consensus (:mod:`estimator.walls.line_detection`). But
the image itself stands above what is beside it all along the wall. Every pair of peaks is therefore
tried as a pair of ends, of any slant and length, and counts as many cells as are brighter than the
background and than the image a few cells to either side.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import map_coordinates

from estimator.array.resolution_cell import Resolution
from estimator.imaging.survey_2d import Survey
from estimator.walls.line_detection import SKIRT, LineCandidate, on_segment

SAMPLES = 32
"""Places between two peaks at which the image is read: a cell or less apart on ridges of up to 31
cells; longer walls have, as a rule, the peaks that a consensus needs. [-]"""
LEAST_CELLS = 4.0
"""Shortest ridge: 1.54 times as many cells of the untapered echo. [cells]"""
LIT_SHARE = 0.7
"""Share of the places that stand above what is beside them. Of fully developed speckle of one mean
level, 0.9 are brighter than a tenth of it. [-]"""
ABOVE_BACKGROUND = 8.0
"""Intensity over the background's mean: exponentially distributed noise exceeds it once in three
thousand cells. [-]"""
ABOVE_BESIDE = 3.0
"""Intensity over that of either side: of exponential speckle alike on all three, one place in ten
passes, and hardly :data:`LIT_SHARE` of those on a segment. [-]"""
RIDGE_LEVEL = -ABOVE_BACKGROUND / float(np.log(LIT_SHARE))
"""Mean level of speckle over the background from which so many places stand out: 13.5 dB. [-]"""
ASIDE = 3.0
"""Distance to either side: the survey's main lobe ends at 1.4. [cells]"""
MOST_ENDS = 160
"""Strongest peaks that are tried as ends: 13 000 pairs. [-]"""
MOST_RIDGES = 8
"""Ridges at which the search ends, for time: each is a candidate that is fitted. It does not bind:
in nine random rooms for tuning there were three at most, and in no echo of ``python -m
validation.experiments.thresholds limits`` are there as many. Of more short walls the shortest
would be lost. [-]"""


def find_ridges(
    looked: Survey, usable: Bool[np.ndarray, " peaks"], resolution: Resolution
) -> tuple[LineCandidate, ...]:
    """Find the segments between two peaks along which the image is a ridge; the longest first.

    Parameters
    ----------
    looked
        The image and its peaks.
    usable
        Which of the peaks may be ends.
    resolution
        Of the image.

    Returns
    -------
    Segments, each with the number of lit cells as its inliers; none has an end on another.
    """
    peaks = looked.peaks[usable][:MOST_ENDS]
    first, second = np.triu_indices(len(peaks), k=1)
    along = peaks[second] - peaks[first]
    length = np.linalg.norm(along, axis=-1)
    middle = 0.5 * (peaks[first] + peaks[second])
    cells = length / width_of(middle, along / np.maximum(length, 1e-9)[:, None], resolution)
    long = cells >= LEAST_CELLS
    first, second, cells = first[long], second[long], cells[long]
    share = _lit_share(looked, peaks[first], peaks[second], resolution)
    score = np.where(share >= LIT_SHARE, share * cells, 0.0)
    return best_segments(peaks, (first, second), score, score, resolution)


def best_segments(
    peaks: Float[np.ndarray, "peaks 3"],
    pairs: tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]],
    score: Float[np.ndarray, " pairs"],
    cells: Float[np.ndarray, " pairs"],
    resolution: Resolution,
) -> tuple[LineCandidate, ...]:
    """Pick the segments of the highest scores, none with an end on another.

    Parameters
    ----------
    peaks
        The ends. [m]
    pairs
        First and second end of each segment.
    score
        What is picked by; 0: never.
    cells
        What a segment has as its inliers.
    resolution
        Of the image.
    """
    (first, second), left = pairs, score.copy()
    found: list[LineCandidate] = []
    while left.size and left.max() > 0 and len(found) < MOST_RIDGES:
        best = int(np.argmax(left))
        line = LineCandidate(
            start=peaks[first[best]], end=peaks[second[best]], inliers=round(cells[best])
        )
        found.append(line)
        gone = on_segment(peaks, line, resolution, tolerance=SKIRT)
        gone[[first[best], second[best]]] = True
        left[gone[first] | gone[second]] = 0.0
    return tuple(found)


def width_of(
    points: Float[np.ndarray, "*n 3"], directions: Float[np.ndarray, "*n 3"], resolution: Resolution
) -> Float[np.ndarray, "*n"]:
    """Return the resolution cell at points, each along its own direction. [m]."""
    reach = np.linalg.norm(points, axis=-1)
    radial = np.abs(np.sum(points * directions, axis=-1)) / reach
    aside = np.sqrt(np.clip(1 - radial**2, 0.0, None))
    width: np.ndarray = 1 / np.hypot(
        radial / resolution.along_ray, aside / (resolution.across_ray * reach)
    )
    return width


def _lit_share(
    looked: Survey,
    starts: Float[np.ndarray, "pairs 3"],
    ends: Float[np.ndarray, "pairs 3"],
    resolution: Resolution,
) -> Float[np.ndarray, " pairs"]:
    """Return the share of each segment along which the image is a ridge. [-]."""
    intensity = np.abs(looked.values) ** 2
    shares = np.linspace(0, 1, SAMPLES)[:, None, None]
    places = starts + shares * (ends - starts)
    along = (ends - starts) / np.linalg.norm(ends - starts, axis=-1, keepdims=True)
    normals = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=-1)
    normals = np.broadcast_to(normals, places.shape)
    aside = ASIDE * width_of(places, normals, resolution)[..., None] * normals
    on, left, right = (
        intensity_at(looked, intensity, places + shift) for shift in (0, aside, -aside)
    )
    lit = (on > ABOVE_BACKGROUND * looked.background) & (
        on > ABOVE_BESIDE * np.maximum(left, right)
    )
    return np.asarray(lit.mean(axis=0))


def intensity_at(
    looked: Survey,
    intensity: Float[np.ndarray, "ranges sines"],
    points: Float[np.ndarray, "*n 3"],
) -> Float[np.ndarray, "*n"]:
    """Read the survey's intensity between its pixels; 0 outside."""
    ranges = np.linalg.norm(looked.points[:, 0], axis=-1)
    sines = looked.points[0, :, 0] / ranges[0]
    reach = np.linalg.norm(points, axis=-1)
    rows = (reach - ranges[0]) / (ranges[1] - ranges[0])
    columns = (points[..., 0] / reach - sines[0]) / (sines[1] - sines[0])
    read = map_coordinates(intensity, [rows, columns], order=1, mode="constant")
    return np.asarray(read)
