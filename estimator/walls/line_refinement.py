"""Refinement of lines found in the image by least squares on the echo itself."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from estimator.array.linear_array import echo_reach, echo_resolution
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.imaging.focusing import Focus, PreparedEcho, focus_within
from estimator.imaging.survey_2d import Survey
from estimator.measurement.model import Echo
from estimator.walls.fitted_line import FittedLine, is_uncertain
from estimator.walls.line_fit_echo import CoherentLine, fit_coherently
from estimator.walls.line_relations import BEYOND_END, lies_on

DISAGREEMENT = 6.0
"""Squared difference of the image's and the echo's line, over the sum of both covariances, beyond
which both are taken to be too small and are enlarged. Of 116 lines in 33 rooms it was 5 to 16 in
corners, and 3.3 at most elsewhere; on walls of 2 mm correlation length, which show a few glints
only, it may be as large. [-]"""
MOST_BESIDE = 12
"""Things brighter than a wall that are told apart from its echo; weaker ones do not pull it. Each
adds nine unknowns to the fit. [-]"""
BESIDE_STEPS = np.array([-0.5, 0.0, 0.5])
"""Places along and across the ray at which such a thing may scatter: it is no ideal point. [cells]
"""
CUT_SHARE = 0.3
"""Part of its length by which a wall may go on where the unambiguous range ends. Nothing is seen
there that could tell more; a row too long costs precision, one too short turns the line. [-]"""

MOST_DEVIATIONS = 6.0
"""Deviations of the image's line, of its tilt and its offset together, beyond which a row that
leaves much of the echo unexplained is not believed. Of 118 lines in 33 rooms such rows moved eight
by 9 to 13, all in right-angled corners, where what both walls reflect comes from the ranges of each
wall's own echo; all moved away from the truth, by 0.1° to 0.4°. [-]"""
EXPLAINED = 0.9
"""Share of the echo at a wall's ranges that its row explains where nothing else is: 0.93 to 0.996
in these rooms, and 0.6 to 0.76 in their corners. [-]"""


def refine_by_echo(
    echo: Echo,
    looked: Survey,
    lines: Sequence[FittedLine],
    *,
    prepared: PreparedEcho | None = None,
) -> tuple[FittedLine, ...]:
    """Place lines as the whole echo says; see :mod:`estimator.walls.line_fit_echo`.

    Parameters
    ----------
    echo
        In the array's frame.
    looked
        Its survey: what is bright beside a line has a part in the echo from the same ranges.
    lines
        As fitted to the image.
    prepared
        The echo, if it was looked at before.

    Returns
    -------
    The lines in the same order. One whose echo is not that of a straight rough wall is left.
    """
    ready = PreparedEcho(echo) if prepared is None else prepared
    tapered = focus_within(ready.tapered, echo_reach(echo)[1])
    places, levels = _bright_beside(
        looked.peaks, lines, tapered, coarse_resolution(echo_resolution(echo))
    )
    return tuple(_refined(echo, line, places[levels > line.level]) for line in lines)


def _bright_beside(
    peaks: Float[np.ndarray, "peaks 3"],
    lines: Sequence[FittedLine],
    tapered: Focus,
    coarse: Resolution,
) -> tuple[Float[np.ndarray, "points 9 3"], Float[np.ndarray, " points"]]:
    """Return the brightest peaks that are on no line, and their intensities.

    Each is a few points, half a cell apart: what stands there is no ideal point.
    """
    beside = np.array(
        [p for p in peaks if not any(lies_on(p, line, coarse, margin=BEYOND_END) for line in lines)]
    ).reshape(-1, 3)
    intensity = np.abs(tapered(beside)) ** 2
    brightest = np.argsort(-intensity)[:MOST_BESIDE]
    beside = beside[brightest]
    distance = np.linalg.norm(beside, axis=-1, keepdims=True)
    ray = beside / distance
    sideways = np.stack([ray[:, 1], -ray[:, 0], ray[:, 2]], axis=-1) * distance * coarse.across_ray
    grid = (
        beside[:, None, None]
        + BESIDE_STEPS[:, None, None] * coarse.along_ray * ray[:, None, None]
        + BESIDE_STEPS[:, None] * sideways[:, None, None]
    )
    return grid.reshape(-1, 9, 3), intensity[brightest]


def _refined(echo: Echo, line: FittedLine, others: Float[np.ndarray, "others 9 3"]) -> FittedLine:
    """Place a line as the whole echo says, if it looks like that of a straight rough wall."""
    resolution, farthest = echo_resolution(echo), echo_reach(echo)[1]
    along = float(resolution.cell(line.middle, line.direction))
    beyond = [
        CUT_SHARE * line.length
        if np.linalg.norm(tip) > farthest - BEYOND_END * along
        else BEYOND_END * along
        for tip in (line.start, line.end)
    ]
    found = fit_coherently(
        echo,
        line.start,
        line.end,
        cell_along=along,
        cell_across=float(resolution.cell(line.middle, line.normal)),
        beyond=(beyond[0], beyond[1]),
        others=others.reshape(-1, 3),
    )
    if found is None or is_uncertain(replace(line, covariance=found.covariance), resolution):
        return line
    if found.explained < EXPLAINED and _deviations(line, found) > MOST_DEVIATIONS:
        return line
    covariance = found.covariance * _excess(line, found)
    late = found.late if found.explained >= EXPLAINED else None
    return replace(line, start=found.start, end=found.end, covariance=covariance, late=late)


def _change(line: FittedLine, moved: CoherentLine) -> Float[np.ndarray, " 2"]:
    """Return the angle by which a line was turned [rad], and by how much it was moved [m]."""
    starts, ends = (moved.start - line.start) @ line.normal, (moved.end - line.end) @ line.normal
    # The normal is to the right: an end that moves along it turns the line clockwise.
    return np.array([(starts - ends) / line.length, 0.5 * (starts + ends)])


def _deviations(line: FittedLine, moved: CoherentLine) -> float:
    """Return how far a line was moved, in its own deviations of tilt and offset."""
    return float(np.sqrt(_change(line, moved) ** 2 @ (1 / np.diag(line.covariance))))


def _excess(line: FittedLine, moved: CoherentLine) -> float:
    """Return by how much variances have to grow for image and echo to agree, if they do not."""
    change = _change(line, moved)
    square = float(change @ np.linalg.solve(line.covariance + moved.covariance, change))
    return square / change.size if square > DISAGREEMENT else 1.0
