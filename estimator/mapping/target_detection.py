"""Targets: what the image shows that is no wall, no sidelobe and no cloud around a ghost."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import label

from estimator import false_alarm
from estimator.array.resolution import HALF_POWER
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.array.windows import SURVEY_TAPER
from estimator.geometry.specular_chains import (
    image_over,
    seen_over,
    unfolded,
    unfolded_over,
)
from estimator.geometry.specular_chains_2d import possible_chains
from estimator.geometry.wall_2d import Wall, crossing, unit_normal
from estimator.geometry.wall_covariance import place_covariance
from estimator.imaging.peak_detection import mean_background, peak_shift
from estimator.imaging.survey_2d import Survey
from estimator.mapping.diffuse_multipath import between, in_cloud
from estimator.mapping.wall_unfolding import UnfoldedWalls
from estimator.results.estimate import Target
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_relations import BEYOND_END, lies_on

LEAST_COHERENCE = 0.3
"""Of a target over the aperture: with a cloud as strong as itself in its own range it has 0.5;
speckle of a cloud, and sidelobes, stay below 0.2 in nine cases of ten. [-]"""

SIDELOBE = 1e-4
"""Intensity of a sidelobe over its peak: 10 dB above the taper's, for what roughness and a
curved front add. [-]"""
REGION = 0.1
"""Intensity over a target's peak that still belongs to it: −10 dB, inside of any main lobe. [-]"""
WEAKEST = 1e-2
"""Intensity over that of the strongest ghost nearer to the array, seen over the same mirrors, from
which on a later one counts: on full-wave data what is scattered between wall and targets more
than once reaches -26 dB. [-]"""
TOLD = 3.0
"""Bend of a cloud's wavefront from which on its speckle is told from a ghost: the intensity
of a focus without it falls by half at 2.7 rad. [rad]"""
ONE_PLACE = 2.0
"""Distance within which peaks are one or on one ray's or arc's sidelobes, and targets are one or on
a wall: the survey's main lobe ends at 1.4, and a place is off by half a cell. [cells]"""
WINDOW = 40
"""Half the side of the neighbourhood of a peak, for time: 20 of the survey's cells to either side,
where what is straight and longer than 8 is a wall
(:data:`estimator.walls.wall_detection_2d.LEAST_CELLS`), and 1600 cells in all, whose median tells
the background to 4 %. [pixels]"""
WIDE = 2.0
"""Extent of a target that is more than a point, over that of a point. ``python -m
validation.experiments.thresholds answers``: with 1 and 4 the answers in four rooms with posts, a
column and walls' ends are the same, three targets, none false. [-]"""
POINT_WIDTH = 1.7
"""Extent of a point down to :data:`REGION`, over its half-power width: of any lobe that falls
like a parabola in decibels, the square root of 10 dB over 3 dB is 1.8. [-]"""
END_SHARE = 0.05
"""Deviation of a short wall's end, over its length: an end is told to half a cell, and walls are
longer than 8 cells (:data:`estimator.walls.wall_detection_2d.LEAST_CELLS`), as a rule 10. [-]"""
DEVIATION = 0.39
r"""Deviation of a peak's place over cell and amplitude ratio, :math:`\sqrt{6}/2\pi`: the
Cramér–Rao bound for a flat spectrum and an unknown phase. [-]"""


@dataclass(frozen=True, kw_only=True)
class Spot:
    """A peak of the survey with its surroundings."""

    place: Float[np.ndarray, " 3"]  # between the pixels [m]
    intensity: float  # [-]
    background: float  # mean intensity around it [-]
    ends: Float[np.ndarray, "2 3"] | None  # if it is wider than a point [m]
    region: Bool[np.ndarray, "ranges sines"]  # pixels that belong to it
    seen: bool  # as one wave that comes from there
    low: tuple[int, int]  # where the region begins on the survey's grid


def find_targets(
    looked: Survey,
    unfolding: UnfoldedWalls,
    found: Sequence[FittedLine],
    resolution: Resolution,
    aperture: float,
) -> tuple[Target, ...]:
    """Find what is no mirror.

    Parameters
    ----------
    looked
        The image and its peaks.
    unfolding
        The walls.
    found
        All lines of the image, also those that are another view of a wall.
    resolution
        Of the echo.
    aperture
        Length of the array. A flat thing that is shorter mirrors no whole aperture: it is an
        object, and a target as well as a mirror. [m]

    Returns
    -------
    Targets in the array's frame, the strongest first.
    """
    coarse = coarse_resolution(resolution)
    intensity = np.abs(looked.values) ** 2
    threshold = looked.background * false_alarm.threshold(
        false_alarm.TARGET, cells=float(intensity.size)
    )
    coherent = np.maximum(looked.as_point, looked.as_mirror)
    seen = ~looked.bent & (coherent >= LEAST_COHERENCE)
    spots = [
        _spot(looked, intensity, peak, bool(one), coarse)
        for peak, one in zip(looked.peaks, seen, strict=True)
        if not any(lies_on(peak, line, coarse, margin=BEYOND_END) for line in found)
    ]
    faces = [
        _face(index, unfolding)
        for index, wall in enumerate(unfolding.walls)
        if np.linalg.norm(wall.end - wall.start) < aperture
    ]
    targets: list[Target] = []
    kept: list[Spot] = []
    for spot in spots:
        if not spot.seen or spot.intensity < threshold or _continues_a_line(spot, found, coarse):
            continue
        if _belongs_to_another(spot, kept, coarse) or _is_cloud(
            spot, spots, kept, found, coarse, aperture
        ):
            continue
        kept.append(spot)
        target = _target(spot, unfolding, resolution)
        if _is_late(target, targets):
            continue
        if not _is_known(target, targets, unfolding.walls, coarse):
            targets.append(target)
    true = [t for t in targets if not _is_mixed(t, targets, unfolding.walls, coarse)]
    return tuple(sorted([*faces, *true], key=lambda target: -(target.level_db or 0.0)))


def _spot(
    looked: Survey,
    intensity: Float[np.ndarray, "ranges sines"],
    peak: Float[np.ndarray, " 3"],
    seen: bool,
    coarse: Resolution,
) -> Spot:
    """Refine a peak and tell how far it reaches."""
    reach = np.linalg.norm(peak)
    ranges = np.linalg.norm(looked.points[:, 0], axis=-1)
    sines = looked.points[0, :, 0] / ranges[0]
    row = int(np.argmin(np.abs(ranges - reach)))
    column = int(np.argmin(np.abs(sines - peak[0] / reach)))
    low = max(row - WINDOW, 0), max(column - WINDOW, 0)
    window = intensity[low[0] : row + WINDOW + 1, low[1] : column + WINDOW + 1]
    inside = row - low[0], column - low[1]
    parts = label(window > REGION * window[inside], structure=np.ones((3, 3)))[0]
    region = parts == parts[inside]
    background = mean_background(window[~region]) if not region.all() else np.inf
    far = ranges[row] + (ranges[1] - ranges[0]) * peak_shift(intensity[:, column], row)
    sine = sines[column] + (sines[1] - sines[0]) * peak_shift(intensity[row], column)
    ends = None
    columns = np.nonzero(region)[1]
    across = np.ptp(sines[low[1] + columns])
    if across > WIDE * POINT_WIDTH * coarse.across_ray:
        own = 0.5 * POINT_WIDTH * coarse.across_ray
        order = np.argsort(columns, kind="stable")[[0, -1]]
        tips = sines[low[1] + columns[order]] + np.array([own, -own])
        ends = np.stack(
            [
                _at(ranges[low[0] + r], s)
                for r, s in zip(_ridge(window, region, columns[order]), tips, strict=True)
            ]
        )
    return Spot(
        place=_at(far, sine),
        intensity=float(intensity[row, column]),
        background=background,
        ends=ends,
        region=region,
        seen=seen,
        low=low,
    )


def _ridge(
    window: Float[np.ndarray, "rows columns"],
    region: Bool[np.ndarray, "rows columns"],
    columns: np.ndarray,
) -> np.ndarray:
    """Return the brightest row of a region in some columns."""
    rows: np.ndarray = np.argmax(np.where(region, window, -1.0)[:, columns], axis=0)
    return rows


def _at(reach: float, sine: float) -> Float[np.ndarray, " 3"]:
    return np.array([reach * sine, reach * np.sqrt(1 - sine**2), 0.0])


def _belongs_to_another(spot: Spot, kept: Sequence[Spot], coarse: Resolution) -> bool:
    """Tell whether a peak is a part, or a sidelobe along or across the ray, of a stronger one."""
    reach = float(np.linalg.norm(spot.place))
    sine = spot.place[0] / reach
    for other in kept:
        far = float(np.linalg.norm(other.place))
        apart = (
            abs(reach - far) / coarse.along_ray,
            abs(sine - other.place[0] / far) / (coarse.across_ray),
        )
        if max(apart) < ONE_PLACE:
            return True
        if min(apart) < ONE_PLACE and spot.intensity < SIDELOBE * other.intensity:
            return True
        if other.ends is not None and _in_region(spot, other):
            return True
    return False


def _in_region(spot: Spot, other: Spot) -> bool:
    centre = np.argwhere(spot.region)[0] + np.array(spot.low) - np.array(other.low)
    shape = other.region.shape
    inside = bool(np.all(centre >= 0) and centre[0] < shape[0] and centre[1] < shape[1])
    return inside and bool(other.region[tuple(centre)])


def _is_cloud(
    spot: Spot,
    spots: Sequence[Spot],
    kept: Sequence[Spot],
    found: Sequence[FittedLine],
    coarse: Resolution,
    aperture: float,
) -> bool:
    """Tell whether a peak is speckle of the cloud around a stronger target's ghost.

    Inside a cloud, a peak counts only if it is brighter than every peak that its excess wavefront
    curvature identifies as speckle; none counts if the array is too short to resolve that
    curvature.
    """
    for other in kept:
        doors = [line for line in found if _before(line, other.place)]
        if not doors or not in_cloud(spot.place[None], other.place, doors, coarse)[0]:
            continue
        if _cloud_bend(spot.place, doors, coarse, aperture) < TOLD:
            return True
        bent = [one for one in spots if not one.seen]
        places = np.array([one.place for one in bent]).reshape(-1, 3)
        clouded = in_cloud(places, other.place, doors, coarse)
        brightest = max(
            (one.intensity for one, inside in zip(bent, clouded, strict=True) if inside),
            default=0.0,
        )
        if spot.intensity < brightest:
            return True
    return False


def _cloud_bend(
    place: Float[np.ndarray, " 3"],
    doors: Sequence[FittedLine],
    coarse: Resolution,
    aperture: float,
) -> float:
    """Return by how much a cloud's wavefront is bent more than a ghost's. [rad]."""
    reach = float(np.linalg.norm(place))
    hits = [crossing(np.zeros(3), place / reach, door.start, door.end) for door in doors]
    farthest = max((hit[0] for hit in hits if hit is not None), default=reach)
    # k h² with the half aperture h, of the cell λ/2D that the survey's taper widens.
    scale = np.pi * aperture / (4 * coarse.across_ray) * SURVEY_TAPER.half_power_width / HALF_POWER
    cosine = place[1] / reach
    return float(scale * cosine**2 * 0.5 * (1 / farthest - 1 / reach))


def _before(line: FittedLine, point: Float[np.ndarray, " 3"]) -> bool:
    wall = Wall(start=line.start, end=line.end, covariance=line.covariance)
    return bool(unfolded(point[None], [wall], deepest=1)[1][0, 0] == 0)


def _target(spot: Spot, unfolding: UnfoldedWalls, resolution: Resolution) -> Target:
    places, chains = unfolded(spot.place[None], unfolding.walls)
    chain = tuple(int(index) for index in chains[0] if index >= 0)
    ends = spot.ends
    if ends is not None:  # over the same mirrors, whatever their extent
        ends = unfolded_over(ends, unfolding.walls, chain)
    reach = float(np.linalg.norm(spot.place))
    ray = spot.place / reach
    across = unit_normal(np.zeros(3), spot.place)
    ratio = spot.background / spot.intensity
    own = (
        DEVIATION**2
        * ratio
        * (
            resolution.along_ray**2 * np.outer(ray, ray)
            + (resolution.across_ray * reach) ** 2 * np.outer(across, across)
        )
    )
    return Target(
        position=places[0],
        ghost=spot.place,
        seen_through=chain,
        covariance=place_covariance(spot.place, own, unfolding.walls, unfolding.covariance, chain),
        level_db=float(10 * np.log10(spot.intensity)),
        ends=ends,
    )


def _face(index: int, unfolding: UnfoldedWalls) -> Target:
    """Report a short wall as the face of an object."""
    line, wall = unfolding.lines[index], unfolding.walls[index]
    chain = unfolding.seen_through[index]
    return Target(
        position=0.5 * (wall.start + wall.end),
        ghost=line.middle,
        seen_through=chain,
        covariance=_middle_covariance(wall),
        level_db=float(10 * np.log10(line.level)),
        ends=np.stack([wall.start, wall.end]),
    )


def _middle_covariance(wall: Wall) -> Float[np.ndarray, "3 3"]:
    """Across the wall that of its offset; along it, a tenth of its length for either end."""
    along = wall.end - wall.start
    length = float(np.linalg.norm(along))
    along = along / length
    return np.asarray(
        wall.covariance[1, 1] * np.outer(wall.normal, wall.normal)
        + (END_SHARE * length) ** 2 / 2 * np.outer(along, along)
    )


def _continues_a_line(spot: Spot, lines: Sequence[FittedLine], coarse: Resolution) -> bool:
    """Tell whether a peak lies where a wall would go on: what is before it hides a part of it."""
    return any(
        lies_on(
            spot.place,
            line,
            coarse,
            margin=line.length / float(coarse.cell(spot.place, line.direction)),
        )
        for line in lines
    )


def _is_late(target: Target, others: Sequence[Target]) -> bool:
    """Tell whether a weak ghost comes after a strong one over the same mirrors."""
    floor = (target.level_db or 0.0) - 10 * np.log10(WEAKEST)
    return any(
        bool(target.seen_through)
        and other.seen_through == target.seen_through
        and (other.level_db or 0.0) > floor
        and np.linalg.norm(other.ghost) < np.linalg.norm(target.ghost)
        for other in others
    )


def _is_known(
    target: Target, others: Sequence[Target], walls: Sequence[Wall], coarse: Resolution
) -> bool:
    """Tell whether a target is another view of one that is known, or of a wall."""
    reach = float(np.linalg.norm(target.ghost))
    cell = max(coarse.along_ray, coarse.across_ray * reach)
    if any(np.linalg.norm(target.position - other.position) < ONE_PLACE * cell for other in others):
        return True
    for wall in walls:
        along = wall.end - wall.start
        length = float(np.linalg.norm(along))
        place = float((target.position - wall.start) @ along) / length
        beside = np.linalg.norm(target.position - wall.start - place * along / length)
        near = ONE_PLACE * cell
        if beside < near and -near < place < length + near:
            return True
    return False


def _is_mixed(
    target: Target, targets: Sequence[Target], walls: Sequence[Wall], coarse: Resolution
) -> bool:
    """Tell whether a peak is a stronger target, illuminated and received over different chains."""
    reach = 2 * float(np.linalg.norm(target.ghost))  # the mean of two ranges is the target's
    chains = list(possible_chains(walls, reach=reach))
    for other in targets:
        if (other.level_db or 0.0) <= (target.level_db or 0.0):
            continue
        for chain in chains:
            if chain == other.seen_through:
                continue
            image = image_over(other.position[None], walls, chain)
            if not seen_over(image, walls, chain)[0]:
                continue
            if between(target.ghost[None], other.ghost, image[0], coarse)[0]:
                return True
    return False
