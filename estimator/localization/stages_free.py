"""The stages of positions that are neither a line nor a plane with a front: image and targets."""

from dataclasses import dataclass

from estimator.array.array_frame import ArrayFrame
from estimator.array.viewpoint import Viewpoint
from estimator.localization.imaged_scene import ImagedScene, imaged_scene
from estimator.localization.stages import Heard
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.results.estimate import DirectionMap


@dataclass(frozen=True)
class FreeStages:
    """The stages of an array of any shape."""

    view: Viewpoint

    def frame(self, measurement: Measurement) -> ArrayFrame:
        """Return the frame of the image; refuse pilots."""
        if measurement.uplinks:
            raise MeasurementError(
                "uplink: the positions are neither on a line nor in a plane that faces the scene; "
                "users are located with a linear or a planar array"
            )
        return self.view.frame

    def map_room(self, echo: Echo) -> ImagedScene:
        """Image an echo in the array's frame."""
        return imaged_scene(
            echo,
            view=self.view,
            reason="the positions are neither on a line nor in a plane that faces the scene",
        )

    def hear(self, uplink: Uplink, *, clock_known: bool) -> Heard[DirectionMap]:
        """Refuse a pilot."""
        raise MeasurementError(f"uplink of {uplink.user!r}: this array locates no users")
