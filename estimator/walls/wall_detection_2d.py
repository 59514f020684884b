"""Detection of the walls in a linear array's echo: candidates among peaks, fitted and tested."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from estimator import false_alarm
from estimator.array.linear_array import echo_reach, echo_resolution
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.geometry.wall_2d import crossing
from estimator.imaging.focusing import Focus, PreparedEcho, focus_within
from estimator.imaging.range_compression import RangeProfiles
from estimator.imaging.survey_2d import Survey
from estimator.measurement.model import Echo
from estimator.walls.faint_lines import find_faint_lines
from estimator.walls.fitted_line import FittedLine, is_uncertain
from estimator.walls.line_detection import LineCandidate, find_lines
from estimator.walls.line_evidence import depth_of, examine, gain_by_bending, is_from_beyond
from estimator.walls.line_extent import face_ends
from estimator.walls.line_fit_image import fit_between, fit_line
from estimator.walls.line_relations import (
    BEYOND_END,
    hides,
    is_edge_on,
    is_hidden,
    lies_on,
    overlap,
    seen_twice,
)
from estimator.walls.line_sampling import median_level
from estimator.walls.ridge_detection import RIDGE_LEVEL, find_ridges
from estimator.walls.sources_aside import Cleaned, nothing_aside

LEAST_COHERENCE = 0.02
"""Least coherence factor of a peak: sidelobes, and things nearer than the array is long, have 1/M
of M channels; speckle that shares its cell with twenty equal waves has 0.05. [-]"""
MOST_BENT = 0.4
"""Largest share of peaks with excess curvature on a wall's line. Of walls 0.3 to 1.7 m away at all
angles, in simulated and full-wave echoes, it is a quarter at most: on those that nearly face the
array, where many facets share a range. On lines through diffuse multipath and grating lobes it is
from a half to all. [-]"""
MOST_BY_BENDING = 1.04
"""Most intensity that an excess curvature may add to an oblique wall, in the median of its places:
nothing to 13 walls of random rooms, 8 to 34 % to four lines that posts and rough walls made. [-]
"""
OBLIQUE = 0.5
"""Least extent in range of such walls, over their length: on those that nearly face the array many
facets share a range, and a curvature adds up to 21 % by chance. [-]"""
WALL_COHERENCE = 0.2
"""Least median coherence factor of the peaks on a wall that does not reflect the array in itself.
Of the same walls it was 0.3 to 0.98; of ambiguities of range and angle, 0.04 and 0.1. [-]"""
EXPLAINED = 0.5
"""Least share of a wall's echo that its row of scatterers explains, if its peaks are waves that
come from there, and from many ranges. In 160 random rooms 218 walls had 0.53 and more, the back of
a pane of glass 0.05. [-]"""
WELL_EXPLAINED = 0.8
"""The same if its peaks leave that in doubt. Walls that nearly face the array, with many facets in
one range, had 0.98; clouds, ghosts of corners and unconnected peaks 0.7 at most. [-]"""
DIFFERENT = 0.25
"""Distance across of a candidate's ends from the line that follows it, beyond which these are two
lines, of which the echo chooses one. [cells]"""
NOISE_SHARE = 0.02
"""Share of a bright wall's echo that noise and its heights leave unexplained: as at 17 dB of SNR.
[-]"""
LEAST_DEPTH = 3.0
"""Least extent in range of a wall that does not reflect the array in itself: short lines along an
arc of sidelobes had 2.5 at most. [cells]"""
DEEP = 6.0
"""Extent in range from which :data:`EXPLAINED` is enough: the 218 walls had 0.85 and more up to 8
cells, a line through arcs of sidelobes over 3.4 of them 0.52. [cells]"""
MOST_CANDIDATES = 8
"""Most lines sought among all peaks, those with excess curvature included. [-]"""
LEAST_CONTRAST = 10.0
"""Least level of a wall over its surroundings: in diffuse multipath some lines through speckle are
5 dB above it; walls at 20 dB of SNR are 40 dB above theirs. [-]"""
MOST_NOISE = 2.0
"""Most background beside a line, over the image's noise, that still is noise: its mean over nine
lines of a dozen cells each deviates by a tenth. [-]"""
MOST_UNEVEN = 10.0
"""Most that the mean of a faint line's intensity is over what its median lets expect of speckle:
1.5 to 3.3 on seven walls of random rooms, 6500 on a line with a post on it. [-]"""
LEAST_CONFIDENCE = 1 - false_alarm.WALL
"""Confidence of a wall that is reported. [-]"""
NEAREST = 0.5
"""Distance down to which a wall is followed, over the nearest that the survey images: half the
aperture away nothing is peaked, but a wall may go on there. [-]"""
LEAST_CELLS = 8.0
"""Shortest mirror: four cells are cut off for the ends' sidelobes
(:data:`estimator.walls.line_sampling.CELLS_CUT`), and four are left to tell an angle. [cells]"""


def detect_mirrors(
    echo: Echo,
    looked: Survey,
    *,
    prepared: PreparedEcho | None = None,
    aside: Cleaned | None = None,
) -> tuple[FittedLine, ...]:
    """Find the walls that the image shows; the strongest first.

    Parameters
    ----------
    echo
        In the array's frame.
    looked
        Its survey.
    prepared
        The echo, if it was looked at before.
    aside
        The same without bright sources beyond the imaged sector, if they were looked for: where a
        wall leaves the sector, it is followed without the lobes of those that are not on it.

    Returns
    -------
    Lines whose confidence is at least :data:`LEAST_CONFIDENCE`. Nothing tells here whether
    one is seen directly or through another.
    """
    coarse = coarse_resolution(echo_resolution(echo))
    one_wave = np.maximum(looked.as_point, looked.as_mirror) >= LEAST_COHERENCE
    # Among many facets in one range some of a wall's peaks are bent as well; but around a wall
    # that is seen edge-on they are most of what is not on it.
    candidates = [
        *find_lines(looked.peaks[one_wave & ~looked.bent], coarse),
        *find_lines(looked.peaks[one_wave], coarse, most=MOST_CANDIDATES),
        *find_ridges(looked, one_wave, coarse),
    ]
    farthest = echo_reach(echo)[1]
    ready = PreparedEcho(echo) if prepared is None else prepared
    plain, tapered = (focus_within(one, farthest) for one in (ready.plain, ready.tapered))
    profiles = ready.plain.profiles
    half = 0.5 * float(np.ptp(echo.positions[:, 0]))
    seen = nothing_aside(ready) if aside is None else aside
    certain, doubtful = _fitted(echo, looked, candidates, seen, profiles)
    lines = [line for line in _best_of(certain, coarse) if not is_edge_on(line, half)]
    lines = _cut_where_they_cross(lines, echo_resolution(echo), plain, tapered)
    in_sight = [line for line in lines if not is_hidden(line, lines)]
    # Behind a mirror are clouds as well: there only what is seen, not scattered twice, counts.
    behind = np.array(
        [
            any(hides(line, peak) for line in in_sight)
            and not any(lies_on(peak, line, coarse, margin=BEYOND_END) for line in in_sight)
            for peak in looked.peaks
        ],
        dtype=bool,
    )
    ghosts = find_lines(looked.peaks[one_wave & ~looked.bent & behind], coarse)
    certain, more = _fitted(echo, looked, ghosts, seen, profiles)
    # What the peaks leave in doubt, an image of it over a wall proves.
    proved = seen_twice(_best_of([*doubtful, *more], coarse), in_sight, echo_resolution(echo))
    in_sight += [
        line
        for line in proved
        if not is_hidden(line, in_sight)
        and not is_edge_on(line, half)
        and not any(overlap(line, known, coarse) for known in in_sight)
    ]
    for line in _best_of([*certain, *proved], coarse):
        if any(overlap(line, known, coarse) for known in in_sight):
            continue
        if is_hidden(line, in_sight) and not is_edge_on(line, half):
            in_sight.append(_to_its_ends(line, plain, tapered, echo_resolution(echo), half))
    in_sight += _faint(looked, in_sight, echo, plain, tapered)
    return tuple(sorted(in_sight, key=lambda line: -line.level))


def _fitted(
    echo: Echo,
    looked: Survey,
    candidates: Sequence[LineCandidate],
    seen: Cleaned,
    profiles: RangeProfiles,
) -> tuple[list[FittedLine], list[FittedLine]]:
    """Fit candidates that are no part of a line that was fitted.

    Returns
    -------
    Walls that are certain, and lines whose peaks leave it in doubt whether they are walls.
    """
    resolution = echo_resolution(echo)
    coarse = coarse_resolution(resolution)
    trials = looked.values.shape[0] * looked.values.shape[1]
    half, farthest = 0.5 * float(np.ptp(echo.positions[:, 0])), echo_reach(echo)[1]
    lines: list[FittedLine] = []
    doubtful: list[FittedLine] = []
    for candidate in candidates:
        ends = candidate.start, candidate.end
        known = [[lies_on(end, line, coarse, margin=BEYOND_END) for end in ends] for line in lines]
        if any(all(on) for on in known):
            continue  # a part of a wall that was followed to its ends already
        around = seen.with_those_on(candidate.start, candidate.end, coarse)
        plain, tapered = (focus_within(one, farthest) for one in (around.plain, around.tapered))
        line = _fitted_line(echo, candidate, plain, tapered, trials)
        if line is None or line.confidence < LEAST_CONFIDENCE:
            continue
        if line.level < LEAST_CONTRAST * line.background:
            continue
        if _cells(line, resolution) < LEAST_CELLS or is_uncertain(line, resolution):
            continue
        if looked.by_range.is_beyond(_peaks_on(line, looked, coarse)):
            continue
        evidence = examine(echo, line, resolution)
        shallow = evidence.depth < LEAST_DEPTH
        if shallow and not _reflects(line, looked, coarse):
            continue  # along an arc of sidelobes
        oblique = evidence.depth > OBLIQUE * _cells(line, resolution)
        if oblique and gain_by_bending(profiles, line, resolution) > MOST_BY_BENDING:
            continue  # scattered twice
        plain_waves = _is_of_waves(line, looked, coarse)
        if not plain_waves and is_from_beyond(line, looked, profiles, resolution):
            continue
        least = EXPLAINED if plain_waves and evidence.depth >= DEEP else WELL_EXPLAINED
        certain = evidence.explained >= least and (plain_waves or not is_edge_on(line, half))
        (lines if certain else doubtful).append(replace(line, explained=evidence.explained))
    return lines, doubtful


def _faint(
    looked: Survey,
    known: Sequence[FittedLine],
    echo: Echo,
    plain: Focus,
    tapered: Focus,
) -> list[FittedLine]:
    """Fit lines that only their mean shows, where nothing but noise is beside them.

    There chance is known, and no level over the surroundings is asked for.
    """
    resolution = echo_resolution(echo)
    coarse = coarse_resolution(resolution)
    trials = looked.values.shape[0] * looked.values.shape[1]
    half = 0.5 * float(np.ptp(echo.positions[:, 0]))
    found: list[FittedLine] = []
    taken = [LineCandidate(start=one.start, end=one.end, inliers=0) for one in known]
    lobes = looked.peaks[np.maximum(looked.as_point, looked.as_mirror) < LEAST_COHERENCE]
    for candidate in find_faint_lines(looked, taken, coarse):
        if any(_is_at(tip, lobes, coarse) for tip in (candidate.start, candidate.end)):
            continue  # a lobe of something else is no end of a wall
        line = fit_between(
            plain, tapered, candidate.start, candidate.end, resolution, trials=trials
        )
        if line is None or line.confidence < LEAST_CONFIDENCE:
            continue
        if line.background > MOST_NOISE * looked.background:
            continue
        usual = median_level(tapered, line.start, line.end, resolution)
        if usual > RIDGE_LEVEL * line.background or line.level > MOST_UNEVEN * usual:
            continue  # bright ones had their chance; a bright place alone draws a line to itself
        if not _is_of_waves(line, looked, coarse):
            continue
        if is_uncertain(line, resolution) or is_edge_on(line, half):
            continue
        others = [*known, *found]
        if any(overlap(line, one, coarse) or overlap(one, line, coarse) for one in others):
            continue
        if looked.by_range.is_beyond(_peaks_on(line, looked, coarse)):
            continue
        if is_hidden(line, others):
            continue
        if depth_of(line, resolution) < max(LEAST_DEPTH, OBLIQUE * _cells(line, resolution)):
            continue  # along an arc of sidelobes; a wall that nearly faces the array is not faint
        found.append(replace(line, explained=0.0))
    return found


def _is_at(
    place: Float[np.ndarray, " 3"], peaks: Float[np.ndarray, "peaks 3"], coarse: Resolution
) -> bool:
    """Tell whether a place is within a cell of one of some peaks."""
    away = np.linalg.norm(peaks - place, axis=-1)
    across = np.array([place[1], -place[0], 0.0]) / np.linalg.norm(place)
    return bool(np.any(away < float(coarse.cell(place, across))))


def _fitted_line(
    echo: Echo, candidate: LineCandidate, plain: Focus, tapered: Focus, trials: int
) -> FittedLine | None:
    """Fit a candidate as far as it is bright, or between its own ends if that explains it better.

    Followed past its end into something brighter, a post or the corner with another wall, a line
    turns towards that.
    """
    resolution, reach = echo_resolution(echo), echo_reach(echo)
    start, end = candidate.start, candidate.end
    line = fit_line(
        plain,
        tapered,
        start,
        end,
        resolution,
        reach=(NEAREST * reach[0], reach[1]),
        trials=trials,
    )
    own = fit_between(plain, tapered, start, end, resolution, trials=trials)
    if line is None or own is None:
        return line or own
    cell = float(resolution.cell(own.middle, own.normal))
    aside = [abs(float((tip - line.middle) @ line.normal)) for tip in (own.start, own.end)]
    if max(aside) < DIFFERENT * cell:
        return line
    same_part = replace(
        line,
        start=line.middle + float((own.start - line.middle) @ line.direction) * line.direction,
        end=line.middle + float((own.end - line.middle) @ line.direction) * line.direction,
    )
    followed, between = (examine(echo, one, resolution) for one in (same_part, own))
    return own if between.explained > followed.explained else line


def _cells(line: FittedLine, resolution: Resolution) -> float:
    """Return the length of a line. [cells]."""
    return line.length / float(resolution.cell(line.middle, line.direction))


def _peaks_on(line: FittedLine, looked: Survey, coarse: Resolution) -> Bool[np.ndarray, " peaks"]:
    return np.array([lies_on(peak, line, coarse) for peak in looked.peaks], dtype=bool)


def _reflects(line: FittedLine, looked: Survey, coarse: Resolution) -> bool:
    """Tell whether the array is seen reflected in a line."""
    return bool(np.any(looked.reflected[_peaks_on(line, looked, coarse)]))


def _is_of_waves(line: FittedLine, looked: Survey, coarse: Resolution) -> bool:
    """Tell whether the peaks on a line are waves that come from there, as a wall's are."""
    on = _peaks_on(line, looked, coarse)
    if not on.any():
        return True
    if np.mean(looked.bent[on]) > MOST_BENT:
        return False
    coherent = np.maximum(looked.as_point, looked.as_mirror)[on]
    return bool(looked.reflected[on].any()) or float(np.median(coherent)) >= WALL_COHERENCE


def _best_of(lines: Sequence[FittedLine], coarse: Resolution) -> list[FittedLine]:
    """Of lines that lie on each other keep the longest, unless a shorter one explains more."""
    kept: list[FittedLine] = []
    for line in sorted(lines, key=lambda one: -one.length / (1 + NOISE_SHARE - one.explained)):
        if not any(overlap(line, one, coarse) for one in kept):
            kept.append(line)
    return kept


def _cut_where_they_cross(
    lines: Sequence[FittedLine], resolution: Resolution, plain: Focus, tapered: Focus
) -> list[FittedLine]:
    """Cut what lies behind another line off a line that crosses it.

    Walls that meet at a right angle each continue in the other's mirror image, straight: the
    image shows a cross, of which the halves behind the other wall are ghosts.
    """
    cut: list[FittedLine] = []
    for line in lines:
        start, end = line.start, line.end
        for other in lines:
            hit = None if other is line else crossing(start, line.direction, other.start, other.end)
            if hit is None or hit[0] >= float(np.linalg.norm(end - start)):
                continue
            meeting = start + hit[0] * line.direction
            halves = [hides(other, 0.5 * (meeting + tip)) for tip in (start, end)]
            if halves == [True, False]:
                start = meeting
            elif halves == [False, True]:
                end = meeting
        if start is line.start and end is line.end:
            cut.append(line)
            continue
        shorter = fit_between(plain, tapered, start, end, resolution, trials=1)
        # What is left may be too little for a line: speckle then fits at any angle.
        if shorter is not None and not is_uncertain(shorter, resolution):
            cut.append(replace(shorter, confidence=line.confidence))
    return cut


def _to_its_ends(
    line: FittedLine, plain: Focus, tapered: Focus, resolution: Resolution, half: float
) -> FittedLine:
    """Cut a hidden line where its face ends."""
    ends = face_ends(line, plain, resolution, half)
    if ends[0] is line.start and ends[1] is line.end:
        return line
    shorter = fit_between(plain, tapered, *ends, resolution, trials=1)
    return line if shorter is None else replace(shorter, confidence=line.confidence)
