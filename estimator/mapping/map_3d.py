"""The map of a room in space: planes and targets at their true place, ghosts unfolded."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.ndimage
from jaxtyping import Float
from scipy.spatial import cKDTree

from estimator import false_alarm
from estimator.array.array_frame import ArrayFrame
from estimator.array.linear_array import WIDEST_SINE
from estimator.array.planar_array import PlanarArray, planar_resolution
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.geometry.specular_chains import Chain, chain_to, unfolded_over
from estimator.geometry.wall_3d import PlaneWall, hidden_by, mirrored_about
from estimator.geometry.wall_covariance import joint_covariance
from estimator.imaging.range_compression import range_profiles
from estimator.imaging.survey_3d import VolumeSurvey, peaks_around, survey_volume
from estimator.mapping.range_order import (
    other_distances,
    planes_within_range,
    unambiguous_range,
)
from estimator.mapping.wall_unfolding import confidence_of
from estimator.measurement.model import Echo
from estimator.results.estimate import Mirror, Target
from estimator.walls.plane_fit import FittedPlane, plane_axes, towards_array
from estimator.walls.wall_detection_3d import (
    detect_planes,
    lobe_of_a_wall,
    unassigned_peaks,
)

TARGET_LEVEL = 1e-3
"""Intensity, over that of the brightest target, of what still is one: −30 dB. With half and twice
of it the answers in two rooms in space are the same but for one of three false targets, gone at
−27 dB (``python -m validation.experiments.thresholds space``). [-]"""
MOST_TARGETS = 24
"""Targets at which the search ends, for time: two rooms in space show three, with half and twice as
many the same (``python -m validation.experiments.thresholds space``). [-]"""
STANDS_OUT = 25.0
"""Intensity over the background's that a target must reach: of pure background one voxel in 1e10
does. [-]"""
ON_PLANE = 3.0
"""Distance from a plane within which what is seen belongs to it, or another wall's centre if both
are one: twice the survey's main lobe, which ends at 1.4. [cells]"""
SAME_NORMAL = 0.95
"""Product of two normals from which walls within :data:`ON_PLANE` are one: 18°. [-]"""
NEIGHBOURS = 9
"""Side of the neighbourhood of a voxel in which it must not be a skirt: 2 cells to either side hold
the whole main lobe, which ends at 1.4. [pixels]"""
SKIRT = 0.03
"""Intensity over the brightest voxel's in that neighbourhood (−15 dB), below which a voxel belongs
to that one's main lobe: the lobe falls so far 0.93 cells from its peak. [-]"""
FEWEST_VOXELS = 3
"""Pixels of the survey, 0.49 cells apart, that a target must fill: fewer are one speckle's tip.
[pixels]"""
ON_LOBE = 1e-9
"""Distance from a known grating lobe within which a voxel is that lobe: lobes stand at voxels'
places, so that only rounding parts them. [m]"""
LOBE_PIXELS = 2
"""Pixels on either side of a grating lobe's peak that go with it: 0.98 cells, within which its main
lobe falls by :data:`SKIRT`. [pixels]"""
SAME_TARGET = 3.0
"""Distance across the ray within which two targets are one, seen two ways: as for walls
(:data:`ON_PLANE`). [cells]"""
MOST_UNASSIGNED = 24
"""Strongest peaks on no wall that are asked whether they are grating lobes, for time: twice those
that a wall is suspected between (:data:`estimator.positioning.blockage.LOOSE_PEAKS`). [-]"""
MOST_ROOMS = 8
"""Combinations of the walls' distances that users are placed in, for time: two walls with three
distances each have nine. [-]"""
LEAST_BACKGROUND = 1e-300
"""Least background that a level is divided by: above 0 in float64. [-]"""


@dataclass(frozen=True, kw_only=True)
class SpaceTarget:
    """A cluster of bright voxels that is no wall, in the array's frame."""

    position: Float[np.ndarray, " 3"]  # centroid of its intensity, at its true place [m]
    ghost: Float[np.ndarray, " 3"]  # where the raw image shows it [m]
    seen_through: tuple[int, ...]  # indices of walls, from the array outward
    level: float  # highest intensity [-]
    ends: Float[np.ndarray, "2 3"]  # along the direction of its largest extent [m]


@dataclass(frozen=True, kw_only=True)
class SpaceMap:
    """What the echo shows, in the array's frame; planes, walls, seen_through run alike."""

    planes: tuple[FittedPlane, ...]  # as the raw image shows them
    walls: tuple[PlaneWall, ...]  # the same at their true place
    seen_through: tuple[tuple[int, ...], ...]  # indices of walls, from the array outward
    joint_covariance: Float[np.ndarray, "parameters parameters"]
    """Of all walls' (two tilts [rad], offset [m]), one wall after the other."""
    targets: tuple[SpaceTarget, ...]  # strongest first
    unassigned_peaks: Float[np.ndarray, "peaks 3"]
    """Peaks on no wall and behind none, strongest first. [m]"""
    survey: VolumeSurvey


def build_space_map(echo: Echo, array: PlanarArray) -> SpaceMap:
    """Find walls and targets in an echo and put them where they really are.

    Parameters
    ----------
    echo
        In the array's frame.
    array
        Its extents.
    """
    looked = survey_volume(echo, array)
    coarse = coarse_resolution(planar_resolution(array, echo))
    profiles = range_profiles(echo)
    found = detect_planes(echo, array, looked, profiles)
    planes, walls, seen = unfold_planes(
        planes_within_range(found, echo, array, looked, profiles), coarse
    )
    joint = joint_covariance(
        [plane.wall for plane in planes], seen, walls, reflected=mirrored_wall, change=plane_change
    )
    return SpaceMap(
        planes=planes,
        walls=tuple(
            replace(wall, covariance=joint[3 * i : 3 * i + 3, 3 * i : 3 * i + 3])
            for i, wall in enumerate(walls)
        ),
        joint_covariance=joint,
        unassigned_peaks=_of_no_wall(
            unassigned_peaks(looked.peaks, planes, coarse), planes, echo, array
        ),
        seen_through=seen,
        targets=_targets(echo, array, looked, [plane.wall for plane in planes], walls),
        survey=looked,
    )


def _of_no_wall(
    peaks: Float[np.ndarray, "peaks 3"],
    planes: Sequence[FittedPlane],
    echo: Echo,
    array: PlanarArray,
) -> Float[np.ndarray, "kept 3"]:
    """Leave out peaks that are grating lobes of a wall's part outside of the imaged angles. [m]."""
    walls = [plane.wall for plane in planes]
    kept = [
        not lobe_of_a_wall(echo, array, peak[None], np.ones(1), walls)
        for peak in peaks[:MOST_UNASSIGNED]
    ]
    return np.concatenate([peaks[: len(kept)][kept], peaks[len(kept) :]])


def other_rooms(room: SpaceMap, echo: Echo) -> tuple[tuple[float, tuple[PlaneWall, ...]], ...]:
    """Return the walls at all distances that they may have, each choice with its probability."""
    if all(plane.orders[0] == 1.0 for plane in room.planes):
        return ()
    planes = [plane.wall for plane in room.planes]
    orders = [plane.orders for plane in room.planes]
    choices = other_distances(planes, orders, unambiguous_range(echo), most=MOST_ROOMS)
    return tuple((chance, _unfolded(chosen, room)) for chance, chosen in choices)


def _unfolded(chosen: Sequence[PlaneWall], room: SpaceMap) -> tuple[PlaneWall, ...]:
    """Unfold planes at chosen distances as :func:`unfold_planes` does; keep walls that stay."""
    walls: list[PlaneWall] = []
    for plane, fitted, known in zip(chosen, room.planes, room.walls, strict=True):
        chain = chain_to(plane.centre, walls)
        stays = plane is fitted.wall and all(walls[j] is room.walls[j] for j in chain)
        if stays and chain == room.seen_through[len(walls)]:
            walls.append(known)
            continue
        for j in chain:
            plane = mirrored_wall(plane, walls[j])
        walls.append(plane)
    return tuple(walls)


def peaks_aside(
    echo: Echo,
    array: PlanarArray,
    room: SpaceMap,
    heading: Float[np.ndarray, " 3"],
    farthest: float,
) -> Float[np.ndarray, "peaks 3"] | None:
    """Return peaks on no wall around a direction outside of the surveyed ones. [m].

    Parameters
    ----------
    echo, array
        As the map was built from.
    room
        The map.
    heading, farthest
        As in :func:`estimator.imaging.survey_3d.peaks_around`.

    Returns
    -------
    The peaks, strongest first; ``None`` if the direction is nearly in the array's plane.
    """
    if max(abs(float(heading[0])), abs(float(heading[2]))) > WIDEST_SINE:
        return None
    peaks = peaks_around(echo, array, room.survey, heading, farthest)
    coarse = coarse_resolution(planar_resolution(array, echo))
    return unassigned_peaks(peaks, room.planes, coarse)


def unfold_planes(
    planes: Sequence[FittedPlane], resolution: Resolution
) -> tuple[tuple[FittedPlane, ...], tuple[PlaneWall, ...], tuple[tuple[int, ...], ...]]:
    """Unfold planes that are seen through others.

    Parameters
    ----------
    planes
        As the raw image shows them, in the array's frame.
    resolution
        Of the image.

    Returns
    -------
    The planes that are walls, those seen directly first; their true places; and the walls that
    each is seen over, from the array outward.
    """

    def behind(plane: FittedPlane, other: FittedPlane) -> bool:
        return plane is not other and bool(hidden_by(plane.wall.centre[None], other.wall)[0])

    direct = [a for a in planes if not any(behind(a, b) for b in planes)]
    ordered, walls = list(direct), [plane.wall for plane in direct]
    seen: list[Chain] = [()] * len(direct)
    hidden = [plane for plane in planes if not any(plane is other for other in direct)]
    # A wall that others are seen over is nearer than they are: it is unfolded before them.
    for plane in sorted(hidden, key=lambda one: float(np.linalg.norm(one.wall.centre))):
        chain = chain_to(plane.wall.centre, walls)
        unfolded = plane.wall
        for index in chain:
            unfolded = mirrored_wall(unfolded, walls[index])
        if not chain or any(_coincide(unfolded, wall, resolution) for wall in walls):
            continue  # hidden by a ghost alone, or a known wall, seen once more
        ordered.append(plane)
        walls.append(unfolded)
        seen.append(chain)
    return tuple(ordered), tuple(walls), tuple(seen)


def plane_change(new: PlaneWall, old: PlaneWall) -> Float[np.ndarray, " 3"]:
    """Return (slopes along the axes, offset [m]) by which a plane left its old place."""
    rise = float(new.normal @ old.normal)
    slopes = -(old.axes @ new.normal) / rise
    offset = float((new.centre - old.centre) @ new.normal) / rise
    return np.array([*slopes, offset])


def mirrored_wall(wall: PlaneWall, mirror: PlaneWall) -> PlaneWall:
    """Return a wall at its image's place in a mirror, its normal still towards the array."""
    normal = mirror.normal
    centre = mirrored_about(wall.centre, mirror)
    axes = wall.axes - 2 * np.outer(wall.axes @ normal, normal)
    new = plane_axes(towards_array(centre, np.cross(axes[0], axes[1])))
    # A rise along the old normal over the old axes is one along the new normal (which is the
    # old one or its opposite) over the new axes.
    change = np.zeros((3, 3))
    change[:2, :2], change[2, 2] = new @ axes.T, 1.0
    change *= np.sign(
        np.cross(new[0], new[1]) @ (wall.normal - 2 * (wall.normal @ normal) * normal)
    )
    return PlaneWall(
        corners=mirrored_about(wall.corners, mirror),
        centre=centre,
        axes=new,
        covariance=change @ wall.covariance @ change.T,
    )


def _coincide(wall: PlaneWall, other: PlaneWall, resolution: Resolution) -> bool:
    beside = abs(float((wall.centre - other.centre) @ other.normal))
    cell = float(resolution.cell(wall.centre, other.normal))
    return beside < ON_PLANE * cell and abs(float(wall.normal @ other.normal)) > SAME_NORMAL


def _targets(
    echo: Echo,
    array: PlanarArray,
    looked: VolumeSurvey,
    planes: Sequence[PlaneWall],
    walls: Sequence[PlaneWall],
) -> tuple[SpaceTarget, ...]:
    """Gather the bright voxels off the walls into clusters and unfold those behind walls."""
    resolution = coarse_resolution(planar_resolution(array, echo))
    intensity = np.abs(looked.values) ** 2
    ranges, along, up = np.meshgrid(looked.ranges, looked.along, looked.up, indexing="ij")
    ahead = np.sqrt(np.maximum(1 - along**2 - up**2, 0.0))
    points = ranges[..., None] * np.stack([along, ahead, up], axis=-1)
    free = intensity > false_alarm.threshold(false_alarm.PIXEL) * looked.background
    for wall in planes:
        flat = points[free]
        beside = np.abs((flat - wall.centre) @ wall.normal)
        onto = beside < ON_PLANE * resolution.cell(flat, wall.normal)
        free[free] = ~onto
    if not free.any():
        return ()
    strongest = float(intensity[free].max())
    bright = free & (intensity > TARGET_LEVEL * strongest)
    around = scipy.ndimage.maximum_filter(intensity, size=NEIGHBOURS)
    bright &= intensity > SKIRT * around
    if len(looked.lobes):
        lobes = cKDTree(looked.lobes)
        tops = np.argwhere(bright & (intensity == scipy.ndimage.maximum_filter(intensity, size=3)))
        top_points = points[tuple(tops.T)]
        for place in tops[lobes.query(top_points)[0] < ON_LOBE]:
            around_lobe = tuple(slice(max(i - LOBE_PIXELS, 0), i + LOBE_PIXELS + 1) for i in place)
            bright[around_lobe] = False
    patches, count = scipy.ndimage.label(bright, structure=np.ones((3, 3, 3)))
    found: list[SpaceTarget] = []
    sizes = np.bincount(patches.ravel(), minlength=count + 1)
    peaks = scipy.ndimage.maximum(intensity, patches, np.arange(1, count + 1))
    for label in 1 + np.argsort(-np.asarray(peaks), kind="stable"):
        if len(found) == MOST_TARGETS:
            break
        if sizes[label] < FEWEST_VOXELS or peaks[label - 1] < STANDS_OUT * looked.background:
            continue
        members = patches == label
        if lobe_of_a_wall(echo, array, points[members], intensity[members], planes):
            continue
        target = _target(points[members], intensity[members], walls)
        near = SAME_TARGET * resolution.across_ray * float(np.linalg.norm(target.position))
        if any(np.linalg.norm(target.position - other.position) < near for other in found):
            continue  # the same once more, seen another way
        found.append(target)
    return tuple(found)


def _target(
    points: Float[np.ndarray, "voxels 3"],
    intensity: Float[np.ndarray, " voxels"],
    walls: Sequence[PlaneWall],
) -> SpaceTarget:
    weights = intensity / intensity.sum()
    ghost = (weights[:, None] * points).sum(axis=0)
    spread = points - ghost
    axis = np.linalg.svd(spread * np.sqrt(weights)[:, None], full_matrices=False)[2][0]
    places = spread @ axis
    ends = ghost + np.array([[places.min()], [places.max()]]) * axis
    through = chain_to(ghost, walls)
    return SpaceTarget(
        position=unfolded_over(ghost, walls, through),
        ghost=ghost,
        seen_through=through,
        level=float(intensity.max()),
        ends=unfolded_over(ends, walls, through),
    )


def mirrors_in_world(room: SpaceMap, frame: ArrayFrame) -> tuple[Mirror, ...]:
    """Return the walls of a map, as they are reported."""
    mirrors = []
    for plane, wall, through in zip(room.planes, room.walls, room.seen_through, strict=True):
        places = (wall.corners - wall.centre) @ wall.axes.T
        middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
        sides = np.array([[places[:, 0].min(), middle[1]], [places[:, 0].max(), middle[1]]])
        ends = frame.to_world(wall.centre + sides @ wall.axes)
        mirrors.append(
            Mirror(
                start=ends[0],
                end=ends[1],
                normal=frame.turned_to_world(wall.normal),
                covariance=wall.covariance,
                confidence=min(confidence_of(plane.confidence, through), float(plane.orders[0])),
                level_db=float(
                    10 * np.log10(plane.level / max(plane.background, LEAST_BACKGROUND))
                ),
                seen_through=through,
                corners=frame.to_world(wall.corners),
            )
        )
    return tuple(mirrors)


def targets_in_world(room: SpaceMap, frame: ArrayFrame) -> tuple[Target, ...]:
    """Return the targets of a map, as they are reported."""
    return tuple(
        Target(
            position=frame.to_world(target.position),
            ghost=frame.to_world(target.ghost),
            seen_through=target.seen_through,
            level_db=float(10 * np.log10(target.level)),
            ends=frame.to_world(target.ends),
        )
        for target in room.targets
    )
