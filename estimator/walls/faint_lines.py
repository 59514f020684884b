r"""Lines that no single place of a SAR image shows: their mean stands out of the noise.

The face of a rather smooth wall, or of one that is far off the array's mirror direction, scatters
little more than the noise: a handful of its cells pass the threshold of single pixels, as a rule
those of its two ends. The mean over the n cells between the ends stands out by :math:`\sqrt n`
more. Every pair of local maxima is tried as the ends of such a line. Of each place between them the
intensity counts over its own background, clipped:

.. math:: x = \min(I / b, c), \qquad \mathrm{E}\,x = 1 - e^{-c}, \quad
          \mathrm{Var}\,x = 1 - 2 c\,e^{-c} - e^{-2c}

if the place is noise (exponentially distributed with mean b): a few bright places, as where a line
crosses other things, say nothing of the rest. The background includes the sidelobes in the same
range and in the same direction: what the survey's taper leaves of the brightest things there, and
what most places of that range or direction show, as where only a part of the array sees something.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from estimator import false_alarm
from estimator.array.resolution_cell import Resolution
from estimator.compute.distributions import normal_limit
from estimator.imaging.peak_detection import DYNAMIC_RANGE, peaks_above
from estimator.imaging.survey_2d import Survey
from estimator.walls.line_detection import SKIRT, LineCandidate, on_segment
from estimator.walls.line_extent import largest_sum
from estimator.walls.ridge_detection import ASIDE, MOST_ENDS, best_segments, width_of

END = 1e-3
"""False-alarm rate of an end: an image has some dozens of such maxima of noise, and what counts is
the line between two. [per pixel]"""
CLIP = 4.0
"""Largest intensity of a place that counts, over its background. The mean of x then separates a
level of 3 from one of 1 by as many deviations as any: 2 % less at 3 and at 6. [-]"""
SAMPLES = 64
"""Places between two ends; on lines of up to 64 cells there is more than one for each, and these
count as one. [-]"""
CUT = 3.0
"""Distance from either end that is left out: an end is bright, and the survey's lobe ends at 1.4
cells (:data:`estimator.walls.ridge_detection.ASIDE`). [cells]"""
BESIDE_NOISE = 2.0
"""Median beside a line, over that of noise, up to which it is noise: of n exponential intensities
it errs by 1.44/√n, half of it for the fewest cells that count. [-]"""
BESIDE_DEVIATION = 1.6
"""Deviation of the mean over a line, relative to a median beside it, over that relative to noise,
whose level is known: the median's own error moves the clipped mean x by 0.8 of it. [-]"""
LEAST_CELLS = 8.0
"""Shortest part between: with fewer, only lines that single places show pass. [cells]"""


def find_faint_lines(
    looked: Survey, known: Sequence[LineCandidate], resolution: Resolution
) -> tuple[LineCandidate, ...]:
    """Find the segments between two maxima whose mean stands out; the clearest first.

    Parameters
    ----------
    looked
        The image.
    known
        Lines that were found already, of which no part counts.
    resolution
        Of the image.

    Returns
    -------
    Segments, each with the number of its cells as its inliers; none has an end on another.
    """
    over = _over_background(looked)
    pixels = looked.points.reshape(-1, 3)
    free = np.ones(over.shape)
    for line in known:
        free[on_segment(pixels, line, resolution, tolerance=SKIRT).reshape(over.shape)] = 0.0
    least = false_alarm.threshold(END)
    peaks = peaks_above(over, looked.points, least, most=MOST_ENDS)[0]
    first, second = np.triu_indices(len(peaks), k=1)
    along = peaks[second] - peaks[first]
    length = np.linalg.norm(along, axis=-1)
    middle = 0.5 * (peaks[first] + peaks[second])
    cells = length / width_of(middle, along / np.maximum(length, 1e-9)[:, None], resolution)
    long = cells >= LEAST_CELLS + 2 * CUT
    first, second, cells = first[long], second[long], cells[long]
    if not first.size:
        return ()
    least = normal_limit(false_alarm.WALL / first.size)
    significance = _significance(
        looked, over, free, peaks[first], peaks[second], cells, least, resolution
    )
    score = np.where(significance >= least, significance, 0.0)
    found = best_segments(peaks, (first, second), score, cells, resolution)
    lit = [_lit_part(looked, over, line) for line in found]
    return tuple(line for line in lit if line.inliers >= LEAST_CELLS + 2 * CUT)


def _lit_part(
    looked: Survey, over: Float[np.ndarray, "ranges sines"], line: LineCandidate
) -> LineCandidate:
    """Cut off where a line is as dark as noise.

    A maximum of noise may lie on a wall's extension, and then is taken for its end. The part that
    is left has the largest sum of intensities above the level half-way between noise and the whole
    line's: the place of a change in a mean is likeliest there.
    """
    places = line.start + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (line.end - line.start)
    read = np.minimum(over.ravel()[_pixels(looked, places)], CLIP)
    first, last = largest_sum(read - 0.5 * (1 - np.exp(-CLIP) + read.mean()))
    share = (last - first) / (SAMPLES - 1)
    return LineCandidate(start=places[first], end=places[last], inliers=round(share * line.inliers))


def _significance(
    looked: Survey,
    over: Float[np.ndarray, "ranges sines"],
    free: Float[np.ndarray, "ranges sines"],
    starts: Float[np.ndarray, "pairs 3"],
    ends: Float[np.ndarray, "pairs 3"],
    cells: Float[np.ndarray, " pairs"],
    least: float,
    resolution: Resolution,
) -> Float[np.ndarray, " pairs"]:
    """Return by how many deviations of noise segments are brighter than it, and than either side.

    Parameters
    ----------
    looked
        The image.
    over
        Its intensity over the background.
    free
        1 where no line is known yet, and 0 else.
    starts, ends
        Of the segments. [m]
    cells
        Their lengths. [cells]
    least
        Deviations below which the sides of a segment are not asked. [-]
    resolution
        Of the image.
    """

    def mean_over(
        places: Float[np.ndarray, "samples some 3"], usual: Float[np.ndarray, "*some"]
    ) -> Float[np.ndarray, " some"]:
        pixels = _pixels(looked, places)
        read = np.minimum(over.ravel()[pixels] / usual, CLIP) * free.ravel()[pixels]
        return np.asarray(read.sum(axis=0) / np.maximum(counts, 1))

    def median_over(places: Float[np.ndarray, "samples some 3"]) -> Float[np.ndarray, " some"]:
        return np.asarray(np.median(over.ravel()[_pixels(looked, places)], axis=0))

    cut = CUT / cells
    shares = (cut[:, None] + (1 - 2 * cut)[:, None] * np.linspace(0, 1, SAMPLES)).T[..., None]
    places = starts + shares * (ends - starts)
    counts = free.ravel()[_pixels(looked, places)].sum(axis=0)
    independent = np.minimum(cells - 2 * CUT, SAMPLES) * counts / SAMPLES
    mean = 1 - np.exp(-CLIP)
    variance = 1 - 2 * CLIP * np.exp(-CLIP) - np.exp(-2 * CLIP)
    deviation = np.sqrt(variance / np.maximum(independent, 1.0))
    on = mean_over(places, np.ones(()))
    significance = np.where(independent >= LEAST_CELLS, (on - mean) / deviation, 0.0)
    # What is beside is read of the few that are bright.
    bright = np.flatnonzero(significance >= least)
    counts, deviation, places = counts[bright], deviation[bright], places[:, bright]
    along = (ends - starts)[bright]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    normals = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=-1)
    normals = np.broadcast_to(normals, places.shape)
    aside = ASIDE * width_of(places, normals, resolution)[..., None] * normals
    usual = np.maximum(
        1.0, np.maximum(*(median_over(places + one * aside) for one in (1, -1))) / np.log(2)
    )
    deviation *= np.where(usual > BESIDE_NOISE, BESIDE_DEVIATION, 1.0)
    over_usual = (mean_over(places, usual) - mean) / deviation
    significance[bright] = np.minimum(significance[bright], over_usual)
    return significance


def _pixels(looked: Survey, points: Float[np.ndarray, "*n 3"]) -> Int[np.ndarray, "*n"]:
    """Return the index of the pixel that is nearest to each point."""
    ranges = np.linalg.norm(looked.points[:, 0], axis=-1)
    sines = looked.points[0, :, 0] / ranges[0]
    reach = np.sqrt(points[..., 0] ** 2 + points[..., 1] ** 2)
    rows = np.rint((reach - ranges[0]) / (ranges[1] - ranges[0])).astype(np.intp)
    columns = np.rint((points[..., 0] / reach - sines[0]) / (sines[1] - sines[0])).astype(np.intp)
    np.clip(rows, 0, len(ranges) - 1, out=rows)
    np.clip(columns, 0, len(sines) - 1, out=columns)
    return np.asarray(rows * len(sines) + columns)


def _over_background(looked: Survey) -> Float[np.ndarray, "ranges sines"]:
    """Return the image's intensity over what noise and sidelobes make of each pixel. [-]."""
    intensity = np.abs(looked.values) ** 2
    background = np.full(intensity.shape, looked.background)
    for axis in (0, 1):
        highest = DYNAMIC_RANGE * intensity.max(axis=axis, keepdims=True)
        most = np.median(intensity, axis=axis, keepdims=True) / np.log(2)
        background = np.maximum(background, np.maximum(highest, most))
    return np.asarray(intensity / background)
