"""Relations between lines and points of an image: on, beyond, hidden, overlapping, edge-on."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from estimator.array.linear_array import echo_resolution
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.geometry.wall_2d import crossing, mirrored
from estimator.imaging.survey_2d import Survey
from estimator.measurement.model import Echo
from estimator.walls.fitted_line import FittedLine

EDGE_DEVIATIONS = 3.0
"""Deviations of its angle by which a wall must miss the array to show it one face: one in 370
walls that point at the array passes for one that does not. [-]"""

BESIDE = 2.0
"""Distance across a line within which a point is on it: the survey's main lobe ends at 1.4 cells,
and a candidate line is off by half a cell. [cells]"""

BEYOND_END = 4.0
"""Distance beyond a line's end within which a peak belongs to it: the ends are found to a few
cells, as speckle hides the last ones. ``python -m validation.experiments.thresholds walls``: of 72
simulated walls the farthest peak was 2.5 cells beyond an end in five families of six, and up to 4.7
cells in the sixth, at 20°; no more than one wall in ten has one beyond. [cells]"""

GOOD_PART = 1 / 3
"""Share of a line on another from which both are one wall, or behind others from which it is
hidden. Of 400 walls that cross at 30° to 90° none shared more; of ten walls that were fitted from
either half, the two lines shared 0.78 at least. [-]"""

MOST = 0.5
"""Share of a line, mirrored, that must be on a wall to prove it: most of it. [-]"""

SAMPLES = 9
"""Points of a line at which such shares are counted, ends included. [-]"""


def hides(line: FittedLine, point: Float[np.ndarray, " 3"]) -> bool:
    """Tell whether a line stands between the array and a point."""
    far = float(np.linalg.norm(point))
    hit = crossing(np.zeros(3), point / far, line.start, line.end)
    return hit is not None and hit[0] < far


def lies_on(
    point: Float[np.ndarray, " 3"],
    line: FittedLine,
    resolution: Resolution,
    *,
    margin: float = 0.0,
) -> bool:
    """Tell whether a point is on a segment.

    Parameters
    ----------
    point
        In the array's frame. [m]
    line
        The segment.
    resolution
        Of the image that the point comes from.
    margin
        Distance beyond either end that still counts; across, it is :data:`BESIDE`. [cells]
    """
    normal = line.normal
    beside = abs(float((point - line.middle) @ normal))
    along = abs(float((point - line.middle) @ line.direction))
    reach = 0.5 * line.length + margin * float(resolution.cell(point, line.direction))
    return beside < BESIDE * float(resolution.cell(point, normal)) and along < reach


def _share_on(
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    line: FittedLine,
    resolution: Resolution,
) -> float:
    """Return the share of a segment that lies on a line. [-]."""
    return float(
        np.mean([lies_on(point, line, resolution) for point in np.linspace(start, end, SAMPLES)])
    )


def overlap(line: FittedLine, other: FittedLine, coarse: Resolution) -> bool:
    """Tell whether more than :data:`GOOD_PART` of a line lies on another."""
    return _share_on(line.start, line.end, other, coarse) > GOOD_PART


def is_hidden(line: FittedLine, others: Sequence[FittedLine]) -> bool:
    """Tell whether more than :data:`GOOD_PART` of a line is behind others, seen from the array."""
    points = np.linspace(line.start, line.end, SAMPLES)
    before = [other for other in others if other is not line]
    hidden = [any(hides(one, point) for one in before) for point in points]
    return bool(np.mean(hidden) > GOOD_PART)


def seen_twice(
    doubtful: Sequence[FittedLine], known: Sequence[FittedLine], resolution: Resolution
) -> list[FittedLine]:
    """Return the doubtful lines that are seen directly and, mirrored, over a known wall.

    Diffuse clouds and grating lobes have no mirror image at the place where a wall has one.

    Parameters
    ----------
    doubtful
        Lines of the image.
    known
        Walls; what is behind one may be an image.
    resolution
        Of the image.
    """
    either = [*known, *doubtful]
    twice: set[int] = set()
    for i, image in enumerate(either):
        for mirror in known:
            if image is mirror or not hides(mirror, image.middle):
                continue
            ends = mirrored(np.stack([image.start, image.end]), mirror.start, mirror.end)
            for j, wall in enumerate(either):
                if wall is image or wall is mirror or hides(mirror, wall.middle):
                    continue
                if _share_on(ends[0], ends[1], wall, resolution) > MOST:
                    twice |= {i, j}
    return [either[i] for i in sorted(twice) if i >= len(known)]


def is_edge_on(line: FittedLine, half: float) -> bool:
    """Tell whether a line points at the array, which so sees both faces: it mirrors to neither.

    Parameters
    ----------
    line
        In the array's frame.
    half
        Half the length of the array. [m]
    """
    normal = line.normal
    deviations = np.sqrt(np.diag(line.covariance)) * [line.middle @ line.direction, 1.0]
    reach = half * abs(float(normal[0])) + EDGE_DEVIATIONS * float(np.linalg.norm(deviations))
    return abs(float(line.middle @ normal)) < reach


def unassigned_peaks(
    echo: Echo, looked: Survey, lines: Sequence[FittedLine]
) -> Float[np.ndarray, "peaks 3"]:
    """Return the survey's peaks that lie neither on a wall nor behind one, strongest first."""
    resolution = coarse_resolution(echo_resolution(echo))
    return np.array(
        [
            peak
            for peak in looked.peaks[~looked.bent]
            if not any(lies_on(peak, line, resolution, margin=BEYOND_END) for line in lines)
            and not any(hides(line, peak) for line in lines)
        ]
    ).reshape(-1, 3)
