"""Detection of the plane walls in a planar array's echo.

A wall shows in two ways. Its roughness scatters from all over it, as speckle: a plane among the
image's peaks. And where it is perpendicular to the ray it returns a plane wave, whose direction and
distance are the wall's normal and offset, to a small part of a wavelength.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import ConvexHull

from estimator import false_alarm
from estimator.array.planar_array import PlanarArray, planar_reach, planar_resolution
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.geometry.wall_3d import PlaneWall, hidden_by, within
from estimator.imaging.backprojection import prepare
from estimator.imaging.focusing import focus_within
from estimator.imaging.range_compression import RangeProfiles
from estimator.imaging.range_gating import gated
from estimator.imaging.survey_3d import VolumeSurvey, lobe_origins
from estimator.measurement.model import Echo
from estimator.walls.plane_detection import find_planes
from estimator.walls.plane_fit import (
    FittedPlane,
    extent_of_plane,
    plane_axes,
    points_on,
    refine_plane,
    towards_array,
)
from estimator.walls.shared_constant import CONFIDENCE
from estimator.wavefronts.curvature_search_3d import search_wavefront
from estimator.wavefronts.no_wave import NoWaveError
from estimator.wavefronts.wave_fit_3d import Wavefront, fit_wavefront

LEAST_CONFIDENCE = 1 - false_alarm.WALL
"""Confidence of a wall that is reported. [-]"""
FLASHES = 6
"""Brightest peaks, beams apart, that are looked at for a flat wave: each wall returns one, from the
foot of its perpendicular, and a box has six. [-]"""
FLAT = 0.25
"""Curvature, over that of a point at the distance, up to which a wave counts as flat. A disc of
one Fresnel zone, √(λR/2) in radius, has half of it; a wall that is larger has none. [-]"""
MOST_VOXELS = 200
"""Brightest voxels of a cluster that are traced to where they may be the grating lobe of: for
time. With half and twice as many the answers in two rooms in space are the same (``python -m
validation.experiments.thresholds space``). [-]"""
STANDS_OUT = 0.25
"""Share of the energy that arrives around its distance that a flat wave must explain: chance
makes flat waves of the speckle of a rough wall, but faint ones. [-]"""
SKIRT = 2.5
"""Distance from a wall within which a peak belongs to it: the main lobe, which ends at 1.4, and a
cell that the wall may be off before it is refined. [cells]"""
DEVIATIONS = 6.0
"""Deviations by which the curvature may miss 0, or must miss a point's. The covariance is estimated
from 25 tiles of the array, of which a few may hold most of the speckle. [-]"""
BEAMS_APART = 3.0
"""Distance of peaks that are looked at each for a flat wave of its own: a wall's own flash is as
wide as the array, which near it is a few beams. [cells λ/2D]"""
GATE_CELLS = 4.0
"""Range beyond the array's extent that is kept for the fit of a flat wave: its main lobe, and what
the peak is off. With 2 and 8 the answers in two rooms in space are the same (``python -m
validation.experiments.thresholds space``). [cells c/2B]"""
ROUNDEST = 1.5
"""Largest curvature tried, over that of a point at the distance: what is rounder is no wall. [-]"""
SAME_DIRECTION = 0.1
"""Distance of two unit vectors, with lengths within half the array, below which two flat waves are
one: 6°. Two walls as near to each other in both would cross before the array. [-]"""
LOBE_CELLS = 1.5
"""Distance from a wall's plane at which its grating lobe's origin may lie: the main lobe, which
ends at 1.4. [cells]"""
MOST = 0.5
"""Share of points, or of intensity, from which most of something is meant. [-]"""
FLASH_CELLS = 4.0
"""Distance beyond the array's extent, from the foot of its perpendicular, up to which a plane shows
no more than the array's reflection: a small plate does so as well, and a constant. [cells]"""
UNIFORM = 0.8
"""Share of the energy around its distance that a mirror's flat wave explains, of which no more is
seen than that wave: a mirror as wide as the array returns the same to all positions. The waves of
three letters at 1 m explained 0.38, 0.41 and 0.59; a mirror's was not measured. [-]"""
INNER = 0.7
"""Where between its centre and its corners a polygon is sampled as well: half of its area is
inside. [-]"""


@dataclass(frozen=True, kw_only=True)
class Planes:
    """Walls as the image shows them, strongest first: nothing tells yet which are ghosts."""

    fitted: tuple[FittedPlane, ...]
    head_on: tuple[bool, ...]  # whether the wall's own flat wave was seen


def detect_planes(
    echo: Echo, array: PlanarArray, looked: VolumeSurvey, profiles: RangeProfiles
) -> Planes:
    """Find the plane walls in an echo.

    Parameters
    ----------
    echo
        In the array's frame.
    array
        Its extents.
    looked
        Its survey.
    profiles
        Its range profiles, not tapered.

    Returns
    -------
    Walls whose confidence is at least :data:`LEAST_CONFIDENCE`.
    """
    fine = planar_resolution(array, echo)
    coarse = coarse_resolution(fine)
    reach = planar_reach(array, echo, passes=2)
    sharp = focus_within(prepare(profiles), reach[1])
    found: list[FittedPlane] = []
    explained: list[float] = []  # by the flat wave of each; 0: none was seen

    def followed(wall: PlaneWall) -> FittedPlane | None:
        return extent_of_plane(
            looked.at,
            wall,
            coarse,
            reach=(looked.ranges[0], looked.ranges[-1]),
            sine=float(looked.along[-1]),
            peak=float(np.abs(looked.values).max()) ** 2,
            trials=looked.values.size,
        )

    for wave in flat_waves(echo, array, looked):
        plane = followed(wall_of_wave(wave, half=2 * array.half))
        if plane is not None and plane.confidence >= LEAST_CONFIDENCE:
            if not any(_same(plane.wall, other.wall, coarse) for other in found):
                found.append(plane)
                explained.append(wave.explained)
    unassigned = looked.peaks[~_explained(looked.peaks, found, coarse)]
    # One after the other: a wall that is followed to its ends takes more peaks than it began with.
    depth = float(looked.ranges[-1] - looked.ranges[0])
    width = 2 * float(looked.along[-1])
    while candidates := find_planes(unassigned, coarse, depth=depth, width=width):
        candidate = candidates[0]
        normal = towards_array(candidate.centre, candidate.normal)
        start = _around(candidate.members, candidate.centre, plane_axes(normal))
        wall = refine_plane(sharp, start, fine)
        plane = None if wall is None else followed(wall)
        again = None if plane is None else refine_plane(sharp, plane.wall, fine)
        used = _among(unassigned, candidate.members)
        if plane is not None and again is not None and plane.confidence >= LEAST_CONFIDENCE:
            plane = replace(plane, wall=again)
            used |= _explained(unassigned, [plane], coarse)
            if not any(_same(plane.wall, other.wall, coarse) for other in found):
                found.append(plane)
                explained.append(0.0)
        unassigned = unassigned[~used]
    order: list[int] = []
    for i in sorted(range(len(found)), key=lambda i: -found[i].level):
        if _small(found[i].wall, array, fine) and explained[i] < UNIFORM:
            continue  # a thing no larger than the array, which it does not mirror
        stronger = [found[j].wall for j in order]
        points = points_on(found[i].wall, fine)[1]
        if not lobe_of_a_wall(echo, array, points, np.abs(looked.at(points)) ** 2, stronger):
            order.append(i)
    fitted = tuple(_in_doubt(found[i], array, fine) for i in order)
    return Planes(fitted=fitted, head_on=tuple(explained[i] > 0 for i in order))


def _in_doubt(plane: FittedPlane, array: PlanarArray, fine: Resolution) -> FittedPlane:
    """Bound the confidence of a plane of which no more is seen than the array's own reflection."""
    if not _small(plane.wall, array, fine):
        return plane
    return replace(plane, confidence=min(plane.confidence, CONFIDENCE))


def _small(wall: PlaneWall, array: PlanarArray, fine: Resolution) -> bool:
    """Tell whether no more of a plane is seen than the array's own reflection."""
    return not bool(beyond_the_flash(wall.corners, wall, array, fine).any())


def beyond_the_flash(
    points: Float[np.ndarray, "points 3"], wall: PlaneWall, array: PlanarArray, fine: Resolution
) -> Bool[np.ndarray, " points"]:
    """Tell which points of a wall show more than the array's reflection in it, and its blur."""
    foot = float(wall.centre @ wall.normal) * wall.normal
    blur = FLASH_CELLS * fine.across_ray * float(np.linalg.norm(foot))
    return np.asarray(np.linalg.norm(points - foot, axis=-1) > array.half + blur)


def lobe_of_a_wall(
    echo: Echo,
    array: PlanarArray,
    points: Float[np.ndarray, "voxels 3"],
    intensity: Float[np.ndarray, " voxels"],
    planes: Sequence[PlaneWall],
) -> bool:
    """Tell whether bright voxels are what a known wall, outside of the imaged angles, repeats as.

    A wall's far part is rough as well, and seen by no other sign; but its grating lobe lies at
    the distance of the wall's plane there.
    """
    strongest = np.argsort(-intensity, kind="stable")[:MOST_VOXELS]
    origins, real = lobe_origins(echo, array, points[strongest])
    flat = origins.reshape(-1, 3)
    resolution = coarse_resolution(planar_resolution(array, echo))
    on_wall = np.zeros(real.shape, dtype=bool)
    for wall in planes:
        beside = np.abs((flat - wall.centre) @ wall.normal)
        near = beside < LOBE_CELLS * resolution.cell(flat, wall.normal)
        on_wall |= near.reshape(real.shape) & real
    explained = on_wall.any(axis=1)
    weights = intensity[strongest]
    return bool(weights[explained].sum() > MOST * weights.sum() > 0)


def flat_waves(echo: Echo, array: PlanarArray, looked: VolumeSurvey) -> tuple[Wavefront, ...]:
    """Find the waves that walls met head-on return, at the brightest peaks of the survey."""
    found: list[Wavefront] = []
    fine = planar_resolution(array, echo)
    for peak in _apart(looked.peaks, BEAMS_APART * fine.across_ray)[:FLASHES]:
        distance = float(np.linalg.norm(peak))
        near = gated(echo, distance, reach=2 * array.half + GATE_CELLS * fine.along_ray)
        cosines = (float(peak[0]) / distance, float(peak[2]) / distance)
        start = search_wavefront(
            near, cosines=cosines, path_length=distance, roundest=ROUNDEST / distance
        )
        try:
            wave = fit_wavefront(
                near,
                cosines=start.cosines,
                path_length=start.path_length,
                curvature=start.curvature,
            )
        except NoWaveError:
            continue  # no summit: not one wave
        point, deviation = 1 / wave.path_length, float(np.sqrt(wave.covariance[3, 3]))
        if wave.explained < STANDS_OUT:
            continue
        flat = abs(wave.curvature) < FLAT * point + DEVIATIONS * deviation
        if not flat or point - wave.curvature < DEVIATIONS * deviation:
            continue  # round, or nothing tells
        if not any(_alike(wave, other, array) for other in found):
            found.append(_flattened(wave))
    return tuple(found)


def _flattened(wave: Wavefront) -> Wavefront:
    """Return the wave as it is once its curvature is known to be 0, to first order."""
    covariance = wave.covariance
    gain = covariance[:3, 3] / covariance[3, 3]
    moved = np.array([*wave.cosines, wave.path_length]) - gain * wave.curvature
    return replace(
        wave,
        cosines=(float(moved[0]), float(moved[1])),
        path_length=float(moved[2]),
        curvature=0.0,
        covariance=covariance[:3, :3] - np.outer(gain, covariance[3, :3]),
    )


def wall_of_wave(wave: Wavefront, *, half: float) -> PlaneWall:
    """Turn the flat wave of a wall met head-on into that wall's plane.

    The wave's direction is the normal and its length the distance of the array's centre; a
    change of the cosines tilts the plane about the foot of that perpendicular.
    """
    direction = wave.direction
    foot = wave.path_length * direction
    axes = plane_axes(-direction)
    # The plane −n·p = d with n = −ŝ: turning ŝ by δ lowers the plane at s by −s·δ (towards n).
    turned = np.array(
        [
            [1.0, -direction[0] / direction[1], 0.0],
            [0.0, -direction[2] / direction[1], 1.0],
        ]
    )
    tilt = axes @ turned.T  # slope along each axis for each cosine
    change = np.zeros((3, 3))
    change[:2, :2] = tilt
    change[2, 2] = -1.0
    square = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return PlaneWall(
        corners=foot + square @ axes,
        centre=foot,
        axes=axes,
        covariance=change @ wave.covariance @ change.T,
    )


def _apart(peaks: Float[np.ndarray, "peaks 3"], angle: float) -> Float[np.ndarray, "kept 3"]:
    """Keep peaks, strongest first, that are some angle and range away from stronger ones."""
    kept: list[np.ndarray] = []
    for peak in peaks:
        distance = float(np.linalg.norm(peak))
        if all(np.linalg.norm(peak - other) > angle * distance for other in kept):
            kept.append(peak)
    return np.array(kept).reshape(-1, 3)


def _alike(wave: Wavefront, other: Wavefront, array: PlanarArray) -> bool:
    apart = np.linalg.norm(wave.direction - other.direction)
    near = abs(wave.path_length - other.path_length) < array.half
    return bool(near and apart < SAME_DIRECTION)


def _around(
    members: Float[np.ndarray, "members 3"],
    centre: Float[np.ndarray, " 3"],
    axes: Float[np.ndarray, "2 3"],
) -> PlaneWall:
    """Return the plane with the convex hull of its peaks."""
    places = (members - centre) @ axes.T
    corners = places[ConvexHull(places).vertices]
    return PlaneWall(
        corners=centre + corners @ axes, centre=centre, axes=axes, covariance=np.zeros((3, 3))
    )


def _same(wall: PlaneWall, other: PlaneWall, resolution: Resolution) -> bool:
    """Tell whether most of a wall lies on another, which was followed to its ends."""
    inner = wall.centre + INNER * (wall.corners - wall.centre)
    points = np.concatenate([wall.centre[None], wall.corners, inner])
    return bool(peaks_on(points, other, resolution).mean() > MOST)


def _explained(
    peaks: Float[np.ndarray, "peaks 3"], planes: Sequence[FittedPlane], resolution: Resolution
) -> Bool[np.ndarray, " peaks"]:
    """Tell which peaks belong to walls that were found, their skirts of sidelobes included."""
    explained = np.zeros(len(peaks), dtype=bool)
    for plane in planes:
        explained |= peaks_on(peaks, plane.wall, resolution)
    return explained


def peaks_on(
    points: Float[np.ndarray, "points 3"], wall: PlaneWall, resolution: Resolution
) -> Bool[np.ndarray, " points"]:
    """Tell which points belong to a wall, its skirt of sidelobes included."""
    beside = np.abs((points - wall.centre) @ wall.normal)
    near: np.ndarray = beside < SKIRT * resolution.cell(points, wall.normal)
    margin = SKIRT * resolution.across_ray * float(np.linalg.norm(wall.centre))
    return np.asarray(near & within(points, wall, margin=margin))


def _among(
    peaks: Float[np.ndarray, "peaks 3"], members: Float[np.ndarray, "members 3"]
) -> Bool[np.ndarray, " peaks"]:
    among: np.ndarray = np.any(np.all(peaks[:, None] == members[None], axis=-1), axis=1)
    return among


def unassigned_peaks(
    peaks: Float[np.ndarray, "peaks 3"], planes: Sequence[FittedPlane], coarse: Resolution
) -> Float[np.ndarray, "unassigned 3"]:
    """Return the peaks that lie neither on a wall nor behind one.

    Parameters
    ----------
    peaks
        Of the survey, or of a piece beside it. [m]
    planes
        Walls as the survey shows them.
    coarse
        Its resolution.
    """
    free = ~_explained(peaks, planes, coarse)
    for plane in planes:
        free &= ~hidden_by(peaks, plane.wall)
    unassigned: np.ndarray = peaks[free]
    return unassigned
