"""The map of a room in space: planes and targets at their true place, ghosts folded back."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.ndimage
from jaxtyping import Complex, Float
from scipy.spatial import cKDTree

from estimator import false_alarm
from estimator.array.planar_array import PlanarArray, planar_resolution
from estimator.array.resolution_cell import Resolution, coarse_resolution
from estimator.geometry.path_tracing_3d import folded_over
from estimator.geometry.specular_chains_3d import (
    Chain,
    chains_in_space,
    image_in_space,
    seen_over_in_space,
    unfolded_in_space,
)
from estimator.geometry.wall_3d import PlaneWall, hidden_by, mirrored_about
from estimator.imaging.survey_3d import VolumeSurvey, survey_volume
from estimator.measurement.model import Echo
from estimator.walls.plane_fit import FittedPlane, plane_axes, towards_array
from estimator.walls.wall_detection_3d import detect_planes, lobe_of_a_wall

TARGET_LEVEL = 1e-3
"""Intensity, over that of the brightest target, of what still is one. [-]"""
MOST_TARGETS = 24
DEEPEST = 3
"""Walls in a chain over which walls and targets are folded."""
DEEPEST_IMAGE = 2
"""The same of the corrected image's voxels."""
STANDS_OUT = 25.0
"""Intensity over the background's that a target must reach: of pure background one voxel in 1e10
does. [-]"""
ON_PLANE = 3.0
"""Distance from a plane within which what is seen belongs to it. [cells]"""
FEWEST_VOXELS = 3
"""Pixels of the survey, 0.44 cells apart, that a target must fill: fewer are one speckle's tip."""


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
    targets: tuple[SpaceTarget, ...]  # strongest first
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
    planes, walls, seen = fold_planes(detect_planes(echo, array, looked).fitted, coarse)
    return SpaceMap(
        planes=planes,
        walls=walls,
        seen_through=seen,
        targets=_targets(echo, array, looked, [plane.wall for plane in planes], walls),
        survey=looked,
    )


def corrected_values(
    looked: VolumeSurvey,
    points: Float[np.ndarray, "*grid 3"],
    walls: Sequence[PlaneWall],
    *,
    skin: float,
) -> Complex[np.ndarray, "*grid"]:
    """Read the survey on points where things really are.

    A point that the array sees directly keeps its value, a hidden one has none; to either comes
    what the raw image shows at its image over each chain of one or two walls, if the line there
    passes over just these.

    Parameters
    ----------
    looked
        The survey.
    points
        In the array's frame. [m]
    walls
        All mirrors, at their true place.
    skin
        How thick the image of a wall is: so far behind it is still the wall itself. [m]
    """
    flat = points.reshape(-1, 3)
    values = looked.at(flat)
    values[unfolded_in_space(flat, walls, deepest=1, skin=skin)[1][:, 0] >= 0] = 0.0
    for chain in chains_in_space(len(walls), deepest=DEEPEST_IMAGE):
        images = image_in_space(flat, walls, chain)
        seen = seen_over_in_space(images, walls, chain, skin=skin)
        values[seen] += looked.at(images[seen])
    return values.reshape(points.shape[:-1])


def fold_planes(
    planes: Sequence[FittedPlane], resolution: Resolution
) -> tuple[tuple[FittedPlane, ...], tuple[PlaneWall, ...], tuple[tuple[int, ...], ...]]:
    """Fold planes that are seen through others.

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
    # A wall that others are seen over is nearer than they are: it is folded before them.
    for plane in sorted(hidden, key=lambda one: float(np.linalg.norm(one.wall.centre))):
        chain = _chain_to(plane.wall.centre, walls)
        folded = plane.wall
        for index in chain:
            folded = mirrored_wall(folded, walls[index])
        if not chain or any(_coincide(folded, wall, resolution) for wall in walls):
            continue  # hidden by a ghost alone, or a known wall, seen once more
        ordered.append(plane)
        walls.append(folded)
        seen.append(chain)
    return tuple(ordered), tuple(walls), tuple(seen)


def _chain_to(place: Float[np.ndarray, " 3"], walls: Sequence[PlaneWall]) -> Chain:
    """Return the walls over which the array sees a point of its raw image."""
    chain = unfolded_in_space(place[None], walls, deepest=DEEPEST)[1][0]
    return tuple(int(index) for index in chain if index >= 0)


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
    return beside < 3 * cell and abs(float(wall.normal @ other.normal)) > 0.95


def _targets(
    echo: Echo,
    array: PlanarArray,
    looked: VolumeSurvey,
    planes: Sequence[PlaneWall],
    walls: Sequence[PlaneWall],
) -> tuple[SpaceTarget, ...]:
    """Gather the bright voxels off the walls into clusters and fold those behind walls."""
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
    # What is a thousandth of the brightest voxel near it may be that one's sidelobe.
    around = scipy.ndimage.maximum_filter(intensity, size=9)
    bright &= intensity > 0.03 * around
    if len(looked.lobes):
        lobes = cKDTree(looked.lobes)
        tops = np.argwhere(bright & (intensity == scipy.ndimage.maximum_filter(intensity, size=3)))
        top_points = points[tuple(tops.T)]
        for place in tops[lobes.query(top_points)[0] < 1e-9]:
            around_lobe = tuple(slice(max(i - 2, 0), i + 3) for i in place)
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
        near = 3 * resolution.across_ray * float(np.linalg.norm(target.position))
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
    through = _chain_to(ghost, walls)
    return SpaceTarget(
        position=folded_over(ghost, walls, through),
        ghost=ghost,
        seen_through=through,
        level=float(intensity.max()),
        ends=folded_over(ends, walls, through),
    )
