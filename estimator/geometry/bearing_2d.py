"""The bearing that a linear array measures: the angle from its axis."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class LinearBearing:
    """The angle θ from the array's axis +x, in the plane z = 0; see :class:`Bearing`."""

    @property
    def coordinates(self) -> list[int]:
        """Those of the plane: x and y."""
        return [0, 1]

    def towards(self, bearing: Float[np.ndarray, " 1"]) -> Float[np.ndarray, " 3"]:
        """Return (cos θ, sin θ, 0)."""
        return np.array([np.cos(bearing[0]), np.sin(bearing[0]), 0.0])

    def of(self, place: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 1"]:
        """Return the place's angle. [rad]."""
        return np.array([np.arctan2(place[1], place[0])])

    def turns(self, ray: Float[np.ndarray, " 2"]) -> Float[np.ndarray, "1 2"]:
        """Return the unit vector along which θ grows."""
        return np.array([[-ray[1], ray[0]]])

    def wrapped(self, difference: Float[np.ndarray, "paths 1"]) -> np.ndarray:
        """Return angles between -π and π."""
        turned: np.ndarray = (difference + np.pi) % (2 * np.pi) - np.pi
        return turned

    def around(
        self, bearing: Float[np.ndarray, " 1"], angle: float
    ) -> list[Float[np.ndarray, " 1"]]:
        """Return the two angles beside."""
        return [bearing + angle, bearing - angle]

    def aoa(self, bearing: Float[np.ndarray, " 1"]) -> float:
        """Return the angle itself. [rad]."""
        return float(bearing[0])

    def elevation(self, bearing: Float[np.ndarray, " 1"]) -> None:
        """Return nothing: a line does not tell it."""

    def told(self, bearing: Float[np.ndarray, " 1"]) -> str:
        """Write the angle in degrees."""
        return f"{np.degrees(bearing[0]):.2f}°"


LINEAR = LinearBearing()
