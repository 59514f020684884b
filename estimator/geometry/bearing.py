r"""The bearing that an array measures of a point's direction, and its derivatives.

A linear array tells the angle θ from its axis, and solves for a place in its plane; a planar array
tells the cosines :math:`(a_x, a_z)` of the direction along its axes, and solves for a place in
space. All positioning code works with either.
"""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float


@runtime_checkable
class Bearing(Protocol):
    """The direction of a place, as an array at the origin measures it."""

    @property
    def coordinates(self) -> list[int]:
        """Which of x, y, z are solved for; the others are 0."""
        ...

    def towards(self, bearing: Float[np.ndarray, " angles"]) -> Float[np.ndarray, " 3"]:
        """Return the unit vector of a bearing."""
        ...

    def of(self, place: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " angles"]:
        """Return the bearing of a place."""
        ...

    def turns(self, ray: Float[np.ndarray, " coordinates"]) -> Float[np.ndarray, "angles _"]:
        """Differentiate the bearing by a place at unit distance, for its unit vector."""
        ...

    def wrapped(self, difference: Float[np.ndarray, "paths angles"]) -> np.ndarray:
        """Return a difference of bearings in its principal range."""
        ...

    def around(
        self, bearing: Float[np.ndarray, " angles"], angle: float
    ) -> list[Float[np.ndarray, " angles"]]:
        """Return bearings beside one, at an angle from it on all sides. [rad]."""
        ...

    def aoa(self, bearing: Float[np.ndarray, " angles"]) -> float:
        """Return the angle from the array's first axis. [rad]."""
        ...

    def elevation(self, bearing: Float[np.ndarray, " angles"]) -> float | None:
        """Return the angle above the plane of that axis and the boresight, None without. [rad]."""
        ...

    def told(self, bearing: Float[np.ndarray, " angles"]) -> str:
        """Write a bearing in degrees, as a person reads it."""
        ...
