"""A room from whose echo a constant was taken out: its plate, if it may be one, and its notes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame
from estimator.localization.stages import MappedRoom
from estimator.measurement.model import Uplink
from estimator.positioning.map_context import MapContext
from estimator.results.estimate import Images, Mirror, Target, UserEstimate
from estimator.walls.shared_constant import CONFIDENCE, SharedConstant


@dataclass(frozen=True, kw_only=True)
class RoomBehindConstant:
    """See :class:`estimator.localization.stages.MappedRoom`."""

    room: MappedRoom
    shared: SharedConstant

    @property
    def context(self) -> MapContext:
        """What users are placed in: the plate is not certain enough."""
        return self.room.context

    @property
    def notes(self) -> tuple[str, ...]:
        """What was taken out, and what else could not be done."""
        return (*self.shared.notes, *self.room.notes)

    def refined(self, found: UserEstimate, uplink: Uplink) -> UserEstimate:
        """Add what the map makes of the pilot."""
        return self.room.refined(found, uplink)

    def mirrors(self, frame: ArrayFrame) -> tuple[Mirror, ...]:
        """Return the mirrors in the world's frame, the plate last."""
        found = self.room.mirrors(frame)
        plate = self._plate(frame)
        return found if plate is None else (*found, plate)

    def targets(self, frame: ArrayFrame) -> tuple[Target, ...]:
        """Return the targets in the world's frame."""
        return self.room.targets(frame)

    def images(self, frame: ArrayFrame, paths: Sequence[Float[np.ndarray, "_ 3"]]) -> Images:
        """Form both images of the rest."""
        return self.room.images(frame, paths)

    def _plate(self, frame: ArrayFrame) -> Mirror | None:
        """Return the part of a plate that reflects each position in itself."""
        shared = self.shared
        if shared.distance is None or shared.level_db is None:
            return None
        low, high = shared.echo.positions.min(axis=0), shared.echo.positions.max(axis=0)
        flat = float(high[2] - low[2]) < 1e-9
        corners = np.array(
            [
                [x, shared.distance, z]
                for x, z in (
                    (low[0], low[2]),
                    (high[0], low[2]),
                    (high[0], high[2]),
                    (low[0], high[2]),
                )
            ]
        )
        tilts = [shared.tilt_deviation**2] * (1 if flat else 2)
        middle = 0.5 * (low[2] + high[2])
        ends = np.array([[low[0], shared.distance, middle], [high[0], shared.distance, middle]])
        return Mirror(
            start=frame.to_world(ends[0]),
            end=frame.to_world(ends[1]),
            normal=frame.turned_to_world(np.array([0.0, -1.0, 0.0])),
            covariance=np.diag([*tilts, shared.deviation**2]),
            confidence=CONFIDENCE,
            level_db=shared.level_db,
            corners=None if flat else frame.to_world(corners),
        )
