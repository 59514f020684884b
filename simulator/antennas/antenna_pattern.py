"""An antenna that looks somewhere: its field over directions, and how fast that falls."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from scenes.schema.antenna import Antenna, Cosine, GaussianBeam, Horn, Isotropic
from simulator.antennas.field_pattern import field_gain, horn_beam_sigma
from simulator.antennas.polarization import VERTICAL, Polarization

ABRUPT = 0.05
"""Angle before the edge of the half space where a cosine's pattern is taken to end abruptly: there
its logarithm falls by 1/0.05 for each radian and power, a nearly empty field. [rad]"""


@dataclass(frozen=True, eq=False)
class AntennaPattern:
    """Field pattern over that of an isotropic antenna; it does not vary with frequency."""

    antenna: Antenna
    aim: Float[np.ndarray, " 3"]  # unit vector
    polarization: Polarization = VERTICAL

    def __call__(
        self,
        directions: Float[np.ndarray, "facets 3"],
        distances: Float[np.ndarray, " facets"],
        frequencies: Float[np.ndarray, " nodes"],
    ) -> Float[np.ndarray, "1 facets"]:
        """Field towards unit directions that leave the antenna. [-]."""
        return field_gain(self.antenna, self.aim, directions)[None, :]

    def towards(self, directions: Float[np.ndarray, "paths 3"]) -> Float[np.ndarray, " paths"]:
        """Field towards unit directions that leave the antenna. [-]."""
        return field_gain(self.antenna, self.aim, directions)

    @property
    def peak(self) -> float:
        """Field on the axis. [-]."""
        return float(field_gain(self.antenna, self.aim, self.aim[None])[0])

    @property
    def width(self) -> float:
        r"""Standard width of a Gaussian beam, :math:`e^{-\psi^2/2\sigma^2}`; else inf. [rad]."""
        match self.antenna:
            case GaussianBeam():
                return self.antenna.sigma_rad
            case Horn():
                return horn_beam_sigma(self.antenna.gain_dbi)
            case _:
                return float("inf")

    @property
    def power(self) -> float:
        """Exponent of the cosine off the axis in the field; 0 where it is no such pattern. [-]."""
        return self.antenna.exponent / 2 if isinstance(self.antenna, Cosine) else 0.0

    @property
    def forward_only(self) -> bool:
        """Whether nothing is radiated behind the antenna."""
        return isinstance(self.antenna, Cosine)

    def off_axis(self, directions: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        """Angle between unit directions and the axis, 0…π. [rad]."""
        apart = directions - self.aim
        half = np.sqrt(np.einsum("...x,...x->...", apart, apart)) / 2
        return np.asarray(2 * np.arcsin(np.minimum(half, 1.0)))

    def field_off_axis(self, angles: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Field over that on the axis, at angles off it; it falls with the angle. [-]."""
        if isinstance(self.antenna, Isotropic):
            return np.ones_like(angles)
        if isinstance(self.antenna, Cosine):
            front = np.cos(np.minimum(angles, np.pi / 2))
            return np.where(angles < np.pi / 2, front**self.power, 0.0)
        return np.asarray(np.exp(-0.5 * (angles / self.width) ** 2))

    def slope_off_axis(self, angles: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """By how much the logarithm of the field falls with the angle off the axis. [1/rad]."""
        if isinstance(self.antenna, Isotropic):
            return np.zeros_like(angles)
        if isinstance(self.antenna, Cosine):  # at the edge of the half space it ends abruptly
            abrupt = np.where(angles < np.pi / 2 - ABRUPT, 0.0, np.inf)
            return np.asarray(self.power * np.tan(np.minimum(angles, np.pi / 2 - ABRUPT)) + abrupt)
        return angles / self.width**2


ISOTROPIC = AntennaPattern(Isotropic(), np.array([0.0, 1.0, 0.0]))
"""The pattern of an isotropic antenna."""
