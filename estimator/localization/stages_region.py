"""The stages of an array of any shape where the user of the program says what is to be imaged."""

from dataclasses import dataclass
from typing import Generic

from estimator.array.array_frame import ArrayFrame
from estimator.array.viewpoint import Viewpoint
from estimator.imaging.scene_image import ImageOptions, refuse_ranges
from estimator.localization.constant_room import RoomBehindConstant
from estimator.localization.imaged_scene import imaged_scene
from estimator.localization.stages import Chart, Heard, MappedRoom, Stages
from estimator.measurement.model import Echo, Measurement, Uplink
from estimator.walls.shared_constant import without_constant


@dataclass(frozen=True)
class RegionStages(Generic[Chart]):
    """The stages of an array, but for the echo: a region of it is imaged, and no room mapped.

    Walls are found from all that an echo shows, and proved by it; a part of it proves none.
    """

    stages: Stages[Chart]
    view: Viewpoint
    options: ImageOptions

    def frame(self, measurement: Measurement) -> ArrayFrame:
        """Find the array's frame; refuse what an array of its shape cannot take."""
        if measurement.echo is not None:
            refuse_ranges(self.options)
        return self.stages.frame(measurement)

    def map_room(self, echo: Echo) -> MappedRoom:
        """Image the region in an echo in the array's frame."""
        shared = without_constant(echo)
        room = imaged_scene(
            shared.echo, view=self.view, options=self.options, reason="a region was asked for"
        )
        return room if shared.level_db is None else RoomBehindConstant(room=room, shared=shared)

    def hear(self, uplink: Uplink, *, clock_known: bool) -> Heard[Chart]:
        """Map a pilot in the array's frame and take its paths out of it."""
        return self.stages.hear(uplink, clock_known=clock_known)
