"""The map of a room from its echo alone: mirrors at their true place, and targets."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame
from estimator.array.linear_array import echo_resolution
from estimator.array.resolution_cell import coarse_resolution
from estimator.geometry.wall_2d import Wall
from estimator.imaging.backprojection import focus
from estimator.imaging.focusing import PreparedEcho
from estimator.imaging.peak_detection import image_contrast
from estimator.imaging.survey_2d import Survey, survey
from estimator.mapping.diffuse_multipath import without_scattered_twice
from estimator.mapping.target_detection import find_targets
from estimator.mapping.wall_unfolding import confidence_of, unfold_seen_lines
from estimator.measurement.model import Echo
from estimator.results.estimate import Mirror, Target
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_refinement import refine_by_echo
from estimator.walls.line_relations import unassigned_peaks
from estimator.walls.sources_aside import without_sources_aside
from estimator.walls.wall_detection_2d import detect_mirrors

MOST_POINTS = 32
"""Strongest peaks on no wall that are tried as what scatters on to a wall, for time: those that are
weaker make no line that stands out. [-]"""


@dataclass(frozen=True, kw_only=True)
class RoomMap:
    """What the echo shows, in the array's frame; lines, walls and seen_through run alike."""

    lines: tuple[FittedLine, ...]  # as the raw image shows them: ghosts where seen through others
    walls: tuple[Wall, ...]  # the same at their true place
    seen_through: tuple[tuple[int, ...], ...]  # indices of walls, from the array outward
    joint_covariance: Float[np.ndarray, "parameters parameters"]
    """Of all walls' (angle [rad], offset [m]), one wall after the other: walls that are unfolded
    about the same mirror err together."""
    targets: tuple[Target, ...]  # what is no mirror, at its true place
    unassigned_peaks: Float[
        np.ndarray, "peaks 3"
    ]  # peaks on no wall and behind none, strongest first [m]
    survey: Survey
    contrast: float
    """Intensity of the brightest over the background, sources beyond the sector included. [-]"""


def build_room_map(echo: Echo) -> RoomMap:
    """Find mirrors and targets in an echo and put them where they really are.

    Parameters
    ----------
    echo
        In the array's frame: its centre at the origin, its line along x, boresight along y.

    Returns
    -------
    The map, in the same frame.
    """
    prepared = PreparedEcho(echo)
    cleaned = without_sources_aside(prepared)
    looked = survey(cleaned.prepared.echo, prepared=cleaned.prepared, values=cleaned.image)
    resolution = echo_resolution(echo)
    lines = detect_mirrors(echo, looked, prepared=prepared, aside=cleaned)
    loose = unassigned_peaks(echo, looked, lines)[:MOST_POINTS]
    points = np.concatenate([loose, cleaned.places])
    levels = np.abs(focus(prepared.tapered, points)) ** 2
    lines = without_scattered_twice(lines, points, levels, coarse_resolution(resolution))
    found = refine_by_echo(echo, looked, lines, prepared=prepared)
    unfolded = unfold_seen_lines(found, resolution)
    aperture = float(np.ptp(echo.positions[:, 0]))
    return RoomMap(
        lines=unfolded.lines,
        walls=unfolded.walls,
        seen_through=unfolded.seen_through,
        joint_covariance=unfolded.covariance,
        targets=find_targets(looked, unfolded, found, resolution, aperture),
        unassigned_peaks=unassigned_peaks(echo, looked, found),
        survey=looked,
        contrast=max(looked.contrast, image_contrast(cleaned.strongest, looked.background)),
    )


def mirrors_in_world(room: RoomMap, frame: ArrayFrame) -> tuple[Mirror, ...]:
    """Return the mirrors of a map, as they are reported."""
    return tuple(
        _mirror(frame, line, wall, through)
        for line, wall, through in zip(room.lines, room.walls, room.seen_through, strict=True)
    )


def targets_in_world(room: RoomMap, frame: ArrayFrame) -> tuple[Target, ...]:
    """Return the targets of a map, as they are reported."""
    return tuple(
        replace(
            target,
            position=frame.to_world(target.position),
            ghost=frame.to_world(target.ghost),
            covariance=None
            if target.covariance is None
            else frame.axes.T @ target.covariance @ frame.axes,
            ends=None if target.ends is None else frame.to_world(target.ends),
        )
        for target in room.targets
    )


def _mirror(frame: ArrayFrame, line: FittedLine, wall: Wall, through: tuple[int, ...]) -> Mirror:
    normal = wall.normal
    middle = 0.5 * (wall.start + wall.end)
    if normal @ middle > 0:  # towards the array
        normal = -normal
    return Mirror(
        start=frame.to_world(wall.start),
        end=frame.to_world(wall.end),
        normal=frame.turned_to_world(normal),
        covariance=wall.covariance,
        confidence=confidence_of(line.confidence, through),
        level_db=float(10 * np.log10(line.level / line.background)),
        seen_through=through,
    )
