"""The interface of the stages that depend on the array's shape: frame, map, paths, images.

:mod:`estimator.localization.stages_2d` has it of linear arrays, :mod:`stages_3d` of planar ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame
from estimator.channel.path import PathSet
from estimator.measurement.model import Echo, Measurement, Uplink
from estimator.positioning.map_context import MapContext
from estimator.results.estimate import (
    AngleRangeMap,
    DirectionMap,
    Images,
    Mirror,
    Target,
    UserEstimate,
)

Chart = TypeVar("Chart", AngleRangeMap, DirectionMap)


@dataclass(frozen=True, kw_only=True)
class Heard(Generic[Chart]):
    """A user's pilot, mapped, and the paths in it."""

    chart: Chart
    paths: PathSet


@runtime_checkable
class MappedRoom(Protocol):
    """What an echo showed, in the array's frame."""

    @property
    def context(self) -> MapContext:
        """What users are placed in."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What could not be done."""
        ...

    def refined(self, found: UserEstimate, uplink: Uplink) -> UserEstimate:
        """Add to an answer from paths what else the map makes of the pilot."""
        ...

    def mirrors(self, frame: ArrayFrame) -> tuple[Mirror, ...]:
        """Return the mirrors in the world's frame."""
        ...

    def targets(self, frame: ArrayFrame) -> tuple[Target, ...]:
        """Return the targets in the world's frame."""
        ...

    def images(self, frame: ArrayFrame, paths: Sequence[Float[np.ndarray, "_ 3"]]) -> Images:
        """Form both images, around the map and some paths in the array's frame."""
        ...


@runtime_checkable
class Stages(Protocol[Chart]):
    """The stages that depend on the array's shape."""

    def frame(self, measurement: Measurement) -> ArrayFrame:
        """Find the array's frame; refuse what an array of this shape cannot take."""
        ...

    def map_room(self, echo: Echo) -> MappedRoom:
        """Find mirrors and targets in an echo in the array's frame."""
        ...

    def hear(self, uplink: Uplink, *, clock_known: bool) -> Heard[Chart]:
        """Map a pilot in the array's frame and take its paths out of it."""
        ...
