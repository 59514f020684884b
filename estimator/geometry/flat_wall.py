"""The interface of a flat wall, in 2-D or 3-D, that ray tracing and ghost unfolding need."""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

GRAZING = 1e-9
"""Least distance from a bounce to the next: a thousand times what rounding makes of metres. [m]"""


@runtime_checkable
class FlatWall(Protocol):
    """A flat mirror of finite extent, with what is known of its line or plane.

    :class:`estimator.geometry.wall_2d.Wall` and :class:`estimator.geometry.wall_3d.PlaneWall`
    are the two there are.
    """

    @property
    def covariance(self) -> Float[np.ndarray, "parameters parameters"]:
        """Of its tilts [rad] and then its offset along the normal [m]."""
        ...

    @property
    def point(self) -> Float[np.ndarray, " 3"]:
        """A point of it. [m]."""
        ...

    @property
    def normal(self) -> Float[np.ndarray, " 3"]:
        """Unit vector across it."""
        ...

    def mirrored(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Mirror points about its line or plane, whatever its extent. [m]."""
        ...

    def moved(self, change: Float[np.ndarray, " parameters"]) -> "FlatWall":
        """Tilt it about its middle and move it along its normal. [rad], [m]."""
        ...

    def hit(
        self, origin: Float[np.ndarray, " 3"], heading: Float[np.ndarray, " 3"]
    ) -> tuple[float, float] | None:
        """Return how far a ray goes to the wall, and how far from its rim it meets it. [m]."""
        ...

    def hits(
        self,
        origins: Float[np.ndarray, "3 #rays"],
        headings: Float[np.ndarray, "3 rays"],
        limits: Float[np.ndarray, " rays"],
    ) -> Float[np.ndarray, " rays"]:
        """Return how far each ray goes to the wall; infinity if it does not within its limit."""
        ...
