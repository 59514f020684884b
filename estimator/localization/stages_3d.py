"""The stages of a planar array, which measures in space."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame
from estimator.array.planar_array import (
    PlanarArray,
    planar_array,
    planar_reach,
    planar_resolution,
)
from estimator.array.viewpoint import Viewpoint
from estimator.channel.angle_range_map_3d import direction_map
from estimator.channel.path import LEAST_SHARE
from estimator.channel.path_extraction_3d import find_space_paths
from estimator.imaging.point_levels import point_levels_db
from estimator.localization.aliasing import aliasing_notes, order_notes
from estimator.localization.close_range import close_scene, too_large
from estimator.localization.constant_room import RoomBehindConstant
from estimator.localization.imaged_scene import ImagedScene, affordable, imaged_scene
from estimator.localization.stages import Heard, MappedRoom
from estimator.mapping.map_3d import (
    SpaceMap,
    build_space_map,
    mirrors_in_world,
    other_rooms,
    peaks_aside,
    targets_in_world,
)
from estimator.mapping.map_images_3d import space_images
from estimator.mapping.range_order import unambiguous_range
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.positioning.map_context import MapContext
from estimator.results.estimate import (
    DirectionMap,
    Images,
    Mirror,
    Target,
    UserEstimate,
)
from estimator.walls.shared_constant import without_constant

CLOSE = 1.5
"""Distance of the strongest thing, over the aperture's diagonal, below which a scene is close: a
room's things are farther away, and polar cells of the array's centre hold there. [-]"""


@dataclass(frozen=True)
class PlanarRoom:
    """What the echo of a planar array showed; see :class:`estimator.localization.stages`."""

    echo: Echo
    array: PlanarArray
    map: SpaceMap

    @cached_property
    def context(self) -> MapContext:
        """What users are placed in."""
        return MapContext(
            walls=self.map.walls,
            wall_covariance=self.map.joint_covariance,
            resolution=planar_resolution(self.array, self.echo),
            imaged=True,
            unassigned_peaks=self.map.unassigned_peaks,
            reach=planar_reach(self.array, self.echo, passes=2)[1],
            widest=self.array.unaliased(self.echo.frequencies, passes=2),
            contrast=self.map.survey.contrast,
            aside=lambda heading, farthest: peaks_aside(
                self.echo, self.array, self.map, heading, farthest
            ),
            levels=partial(point_levels_db, self.echo),
            rooms=other_rooms(self.map, self.echo),
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Where the image ends."""
        sine = self.array.unaliased(self.echo.frequencies, passes=2)
        return (
            *aliasing_notes(max(self.array.spacing), self.echo.frequencies, sine),
            *order_notes(
                [abs(float(wall.centre @ wall.normal)) for wall in self.map.walls],
                [plane.orders for plane in self.map.planes],
                unambiguous_range(self.echo),
            ),
        )

    def refined(self, found: UserEstimate, uplink: Uplink) -> UserEstimate:
        """Return the answer itself: what rough walls scatter is searched in the plane only."""
        return found

    def mirrors(self, frame: ArrayFrame) -> tuple[Mirror, ...]:
        """Return the mirrors in the world's frame."""
        return mirrors_in_world(self.map, frame)

    def targets(self, frame: ArrayFrame) -> tuple[Target, ...]:
        """Return the targets in the world's frame."""
        return targets_in_world(self.map, frame)

    def images(self, frame: ArrayFrame, paths: Sequence[Float[np.ndarray, "_ 3"]]) -> Images:
        """Read both images from the volume, around the map and some paths."""
        return space_images(self.map, frame, planar_resolution(self.array, self.echo), paths)


@dataclass(frozen=True, kw_only=True)
class RoomWithoutWalls:
    """A room in which no wall was found: users are placed in it, targets taken from its image."""

    room: PlanarRoom
    scene: ImagedScene

    @property
    def context(self) -> MapContext:
        """What users are placed in."""
        return self.room.context

    @property
    def notes(self) -> tuple[str, ...]:
        """Where the survey ends, and how the image was formed."""
        return (*self.room.notes, *self.scene.notes)

    def refined(self, found: UserEstimate, uplink: Uplink) -> UserEstimate:
        """Return the answer itself."""
        return self.room.refined(found, uplink)

    def mirrors(self, frame: ArrayFrame) -> tuple[Mirror, ...]:
        """Return none."""
        return ()

    def targets(self, frame: ArrayFrame) -> tuple[Target, ...]:
        """Return the targets in the world's frame."""
        return self.scene.targets(frame)

    def images(self, frame: ArrayFrame, paths: Sequence[Float[np.ndarray, "_ 3"]]) -> Images:
        """Return the image of what was found; around paths, the survey's."""
        return self.room.images(frame, paths) if paths else self.scene.images(frame, paths)


@dataclass(frozen=True)
class PlanarStages:
    """The stages of a planar array."""

    view: Viewpoint

    def frame(self, measurement: Measurement) -> ArrayFrame:
        """Return the array's frame; refuse waves of the plane."""
        if measurement.waves != "spherical":
            raise MeasurementError(
                f"waves = {measurement.waves!r}: a planar array measures in space, where waves are "
                "spherical; measure with a linear array, or give the measurement its true waves"
            )
        return self.view.frame

    def map_room(self, echo: Echo) -> MappedRoom:
        """Find walls and targets in an echo in the array's frame; or image what is close."""
        shared = without_constant(echo)
        room = self._mapped(shared.echo)
        return room if shared.level_db is None else RoomBehindConstant(room=room, shared=shared)

    def _mapped(self, echo: Echo) -> MappedRoom:
        if echo.transmit_positions is not None:
            reason = "transmitters stand apart from the receivers of a planar array"
            return imaged_scene(echo, view=self.view, reason=reason)
        array = planar_array(echo.positions)
        close = close_scene(echo, nearest=CLOSE * 2 * array.half, planar=True)
        unsuited = close or too_large(echo, array)
        if unsuited is not None:
            return imaged_scene(echo, view=self.view, reason=unsuited)
        room = PlanarRoom(echo=echo, array=array, map=build_space_map(echo, array))
        if room.map.planes or not room.map.targets or not affordable(echo, self.view):
            return room
        scene = imaged_scene(echo, view=self.view, reason="no mirror was found", walls="")
        return RoomWithoutWalls(room=room, scene=scene)

    def hear(self, uplink: Uplink, *, clock_known: bool) -> Heard[DirectionMap]:
        """Map a pilot over both cosines and length, and take its paths out of it."""
        array = planar_array(uplink.positions)
        chart = direction_map(uplink, array, least_share=LEAST_SHARE)
        paths = find_space_paths(uplink, array, chart, clock_known=clock_known)
        return Heard(chart=chart, paths=paths)
