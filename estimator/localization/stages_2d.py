"""The stages of a linear array, whose answer lies in its plane."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame, array_frame
from estimator.array.linear_array import NEAREST, echo_reach, echo_resolution, imaged_sine
from estimator.array.viewpoint import Viewpoint
from estimator.channel.angle_range_map_2d import (
    angle_range_map,
    default_angles,
    default_path_lengths,
)
from estimator.channel.path_extraction_2d import find_paths
from estimator.geometry.lateness import combined
from estimator.imaging.look_aside_2d import peaks_aside
from estimator.imaging.point_levels import point_levels_db
from estimator.imaging.range_compression import unambiguous_path
from estimator.localization.aliasing import aliasing_notes, range_notes
from estimator.localization.close_range import close_scene
from estimator.localization.constant_room import RoomBehindConstant
from estimator.localization.imaged_scene import imaged_scene
from estimator.localization.stages import Heard, MappedRoom
from estimator.mapping.map_2d import RoomMap, build_room_map, mirrors_in_world, targets_in_world
from estimator.mapping.map_images_2d import room_images
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.positioning.diffuse_fallback import with_diffuse_search
from estimator.positioning.map_context import MapContext
from estimator.results.estimate import (
    AngleRangeMap,
    Images,
    Mirror,
    Target,
    UserEstimate,
)
from estimator.walls.shared_constant import without_constant

MAP_SAMPLES = 1.5
"""Samples of the angle/range map for each -3 dB width: a peak between them loses 1.3 dB at
most, and is refined off the grid. [-]"""


@dataclass(frozen=True)
class LinearRoom:
    """What the echo of a linear array showed; see :class:`estimator.localization.stages`."""

    echo: Echo
    map: RoomMap

    @cached_property
    def context(self) -> MapContext:
        """What users are placed in."""
        return MapContext(
            walls=self.map.walls,
            wall_covariance=self.map.joint_covariance,
            resolution=echo_resolution(self.echo),
            imaged=True,
            unassigned_peaks=self.map.unassigned_peaks,
            reach=echo_reach(self.echo)[1],
            widest=imaged_sine(self.echo),
            contrast=self.map.contrast,
            late=combined([line.late for line in self.map.lines if line.late is not None]),
            aside=self._aside,
            levels=partial(point_levels_db, self.echo),
        )

    def _aside(
        self, heading: Float[np.ndarray, " 3"], farthest: float
    ) -> Float[np.ndarray, "peaks 3"] | None:
        return peaks_aside(self.echo, self.map.survey, heading, farthest)

    @property
    def notes(self) -> tuple[str, ...]:
        """Where the image ends."""
        spacing = float(np.ptp(self.echo.positions[:, 0])) / (len(self.echo.positions) - 1)
        return (
            *aliasing_notes(spacing, self.echo.frequencies, imaged_sine(self.echo)),
            *range_notes(self.echo, self.map.survey.beyond),
        )

    def refined(self, found: UserEstimate, uplink: Uplink) -> UserEstimate:
        """Add what rough walls scatter of the pilot."""
        room = self.map
        return with_diffuse_search(found, uplink, room.lines, room.walls, room.seen_through)

    def mirrors(self, frame: ArrayFrame) -> tuple[Mirror, ...]:
        """Return the mirrors in the world's frame."""
        return mirrors_in_world(self.map, frame)

    def targets(self, frame: ArrayFrame) -> tuple[Target, ...]:
        """Return the targets in the world's frame."""
        return targets_in_world(self.map, frame)

    def images(self, frame: ArrayFrame, paths: Sequence[Float[np.ndarray, "_ 3"]]) -> Images:
        """Form both images, around the map and some paths in the array's frame."""
        return room_images(self.echo, self.map, frame, paths)


OWN = Viewpoint(frame=ArrayFrame(origin=np.zeros(3), axes=np.eye(3)), ahead=True, flat=True)
"""A linear array, seen in its own frame: its image is the plane before it."""


@dataclass(frozen=True)
class LinearStages:
    """The stages of a linear array."""

    def frame(self, measurement: Measurement) -> ArrayFrame:
        """Find the array's frame."""
        measured = measurement.echo or measurement.uplinks[0]
        return array_frame(measured.positions, measurement.boresight)

    def map_room(self, echo: Echo) -> MappedRoom:
        """Find mirrors and targets in an echo in the array's frame; or image what is close."""
        shared = without_constant(echo)
        room = self._mapped(shared.echo)
        return room if shared.level_db is None else RoomBehindConstant(room=room, shared=shared)

    def _mapped(self, echo: Echo) -> MappedRoom:
        nearest = NEAREST * float(np.ptp(echo.positions[:, 0]))
        if unambiguous_path(echo.frequencies) / 2 < nearest:
            echo_reach(echo)  # refuses it: all ranges would seem close
        try:
            echo_reach(echo)
        except MeasurementError as cause:  # a room's survey has no ranges left
            told = f"{cause}; anything farther away appears at a wrong place"
            return imaged_scene(echo, view=OWN, reason=told)
        reason = close_scene(echo, nearest=nearest, planar=False)
        if reason is not None:
            return imaged_scene(echo, view=OWN, reason=reason)
        return LinearRoom(echo=echo, map=build_room_map(echo))

    def hear(self, uplink: Uplink, *, clock_known: bool) -> Heard[AngleRangeMap]:
        """Map a pilot over angle and length, and take its paths out of it."""
        chart = angle_range_map(
            uplink,
            aoa=default_angles(uplink, cells=MAP_SAMPLES),
            path_length=default_path_lengths(uplink, centre=np.zeros(3), cells=MAP_SAMPLES),
            centre=np.zeros(3),
        )
        return Heard(chart=chart, paths=find_paths(uplink, chart, clock_known=clock_known))
