r"""Linear polarization of antennas: the direction of their field along each ray.

An antenna's field is along the part of its axis of polarization that is across the ray, of unit
length: the pattern tells the rest. A vertical antenna's axis is z. A cross-polar field is in
phase with the co-polar one, on the right of it as seen from the antenna; both together are what
the pattern says.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from scenes.schema.antenna import Antenna
from simulator.numerics.vectors import added, at_least, chosen, cross, dot, scaled, square_root

UPWARD = 1e-6
"""Sine between an antenna's aim and z below which 'horizontal' is along x. [-]"""

ALONG_AXIS = 1e-6
"""Sine between a ray and the axis of polarization below which there is no field. [-]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Polarization:
    """Axis of an antenna's field, and what it sends across it."""

    axis: Float[np.ndarray, " 3"] = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    cross_polar: float = 0.0  # amplitude over the co-polar field's [-]

    @property
    def vertical(self) -> bool:
        """Whether this is the field of a vertical antenna, and nothing across it."""
        return self.cross_polar == 0.0 and self.axis.tolist() == [0.0, 0.0, 1.0]

    def turned(self, turn: Float[np.ndarray, "3 3"]) -> "Polarization":
        """Turn or mirror it: a mirror image has its cross-polar field on the other side."""
        handed = 1.0 if float(np.linalg.det(turn)) > 0 else -1.0
        axis = np.einsum("xy,y->x", turn, self.axis)
        return Polarization(axis=axis, cross_polar=handed * self.cross_polar)

    def field(self, outward: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Field's vector along unit directions that leave the antenna. [-]."""
        vector = field_vector(np.moveaxis(-outward, -1, 0), self.axis, self.cross_polar)
        return np.stack(vector, axis=-1)


VERTICAL = Polarization()
"""The polarization of all antennas unless told otherwise."""


def antenna_polarization(antenna: Antenna, aim: Float[np.ndarray, " 3"]) -> Polarization:
    """Find the axis of an antenna's polarization.

    Parameters
    ----------
    antenna
        Its ``polarization`` is an angle from the vertical, to the right as seen from behind.
    aim
        Unit vector in which it looks.
    """
    cross_db = antenna.cross_polar_db
    cross_polar = 0.0 if cross_db is None else 10.0 ** (cross_db / 20.0)
    angle = math.radians(antenna.polarization_deg)
    if angle == 0.0:
        return Polarization(cross_polar=cross_polar) if cross_polar else VERTICAL
    up = np.array([0.0, 0.0, 1.0])
    right = np.cross(aim, up)
    length = float(np.linalg.norm(right))
    right = right / length if length > UPWARD else np.array([1.0, 0.0, 0.0])
    axis = math.cos(angle) * up + math.sin(angle) * right
    return Polarization(axis=axis, cross_polar=cross_polar)


def field_vector(direction: Any, axis: Any, cross_polar: float = 0.0) -> Any:
    r"""Field of a linearly polarized antenna, seen from where its ray ends.

    For arrays of NumPy and Dr.Jit alike.

    Parameters
    ----------
    direction
        Unit vectors to the antenna, by axis.
    axis
        The antenna's axis of polarization.
    cross_polar
        Amplitude of the cross-polar field over the co-polar one. [-]

    Returns
    -------
    The three components of a unit vector; zero along the axis.
    """
    part = added(axis, direction, -dot(direction, axis))
    length = square_root(dot(part, part))
    unit = scaled(part, chosen(length > ALONG_AXIS, 1.0 / at_least(length, ALONG_AXIS), 0.0))
    if cross_polar == 0.0:
        return unit
    both = added(unit, cross(unit, direction), cross_polar)
    return scaled(both, 1.0 / math.sqrt(1.0 + cross_polar**2))
