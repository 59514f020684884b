"""The bearing that a planar array measures: the cosines of a direction along both its axes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

SIDES = 8
"""Directions beside one that are looked at: between two of them, a straight edge as far off as
they are is missed by 1 - cos 22.5° = 8 % of the angle."""


@dataclass(frozen=True)
class PlanarBearing:
    """The cosines along the array's axes x and z, in front (y ≥ 0); see :class:`Bearing`."""

    @property
    def coordinates(self) -> list[int]:
        """All three."""
        return [0, 1, 2]

    def towards(self, bearing: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " 3"]:
        """Return the unit vector with these cosines."""
        ahead = np.sqrt(max(1 - float(bearing @ bearing), 0.0))
        return np.array([bearing[0], ahead, bearing[1]])

    def of(self, place: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 2"]:
        """Return the place's cosines. [-]."""
        cosines: np.ndarray = place[[0, 2]] / np.linalg.norm(place)
        return cosines

    def turns(self, ray: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "2 3"]:
        """Return what of both axes is across the ray."""
        axes = np.eye(3)[[0, 2]]
        across: np.ndarray = axes - np.outer(axes @ ray, ray)
        return across

    def wrapped(self, difference: Float[np.ndarray, "paths 2"]) -> np.ndarray:
        """Return the difference: cosines do not come around."""
        return difference

    def around(
        self, bearing: Float[np.ndarray, " 2"], angle: float
    ) -> list[Float[np.ndarray, " 2"]]:
        """Return :data:`SIDES` directions on a cone around one."""
        ray = self.towards(bearing)
        side = np.cross(ray, np.eye(3)[int(np.argmin(np.abs(ray)))])
        side = side / np.linalg.norm(side)
        other = np.cross(ray, side)
        turns = 2 * np.pi * np.arange(SIDES) / SIDES
        cone = [
            np.cos(angle) * ray + np.sin(angle) * (np.cos(turn) * side + np.sin(turn) * other)
            for turn in turns
        ]
        return [one[[0, 2]] for one in cone if one[1] > 0]

    def aoa(self, bearing: Float[np.ndarray, " 2"]) -> float:
        """Return the angle from the axis x. [rad]."""
        return float(np.arccos(bearing[0]))

    def elevation(self, bearing: Float[np.ndarray, " 2"]) -> float:
        """Return the angle above the plane z = 0. [rad]."""
        return float(np.arcsin(bearing[1]))

    def told(self, bearing: Float[np.ndarray, " 2"]) -> str:
        """Write both angles from the boresight in degrees."""
        along, up = np.degrees(np.arcsin(bearing))
        return f"{along:.2f}° aside, {up:.2f}° up"


PLANAR = PlanarBearing()
