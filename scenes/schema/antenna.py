"""Antennas of the base station and of the users: kind, polarization, and where they look."""

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.quantities import Angle, Checked, Name, Position

POLARIZATION_DEG = {"vertical": 0.0, "horizontal": 90.0}
"""Angle of the polarizations that have a name. [degree]"""


def _polarization(value: object) -> object:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value in POLARIZATION_DEG or (number and abs(float(str(value))) <= 180.0):
        return value
    raise PydanticCustomError(
        "polarization",
        "must be 'vertical', 'horizontal', or an angle from the vertical between -180 and 180 "
        "degrees; give one of them",
    )


class Polarized(Checked):
    """An antenna of one linear polarization."""

    polarization: Annotated[
        Literal["vertical", "horizontal"] | float, BeforeValidator(_polarization)
    ] = Field(
        "vertical",
        description="'vertical', 'horizontal', or the angle from the vertical, to the right as "
        "seen from behind the antenna [degree]",
    )
    cross_polar_db: float | None = Field(
        None,
        ge=-100,
        le=0,
        description="the cross-polar field over the co-polar one, in phase with it [dB]; "
        "without, none",
    )

    @property
    def polarization_deg(self) -> float:
        """Angle of the polarization from the vertical [degree]."""
        if isinstance(self.polarization, str):
            return POLARIZATION_DEG[self.polarization]
        return self.polarization


class Isotropic(Polarized):
    """An antenna that radiates alike in all directions, 0 dBi."""

    kind: Literal["isotropic"] = "isotropic"


class Directive(Polarized):
    """An antenna with a boresight: towards an object or a point, or along an azimuth."""

    aim: Name | None = Field(None, description="the object at whose centre the antenna looks")
    aim_m: Position | None = Field(None, description="the point at which the antenna looks [m]")
    aim_deg: Angle | None = Field(None, description="the azimuth of its axis from +x [degree]")

    @property
    def aims(self) -> tuple[str, ...]:
        """Which of the aims are given."""
        return tuple(key for key in ("aim", "aim_m", "aim_deg") if getattr(self, key) is not None)

    @model_validator(mode="after")
    def _one_aim_at_most(self) -> "Directive":
        if len(self.aims) > 1:
            raise PydanticCustomError(
                "aims", "has {aims}; keep exactly one of them", {"aims": " and ".join(self.aims)}
            )
        return self


class Cosine(Directive):
    """Power pattern cos^q of the angle off the axis, nothing behind."""

    kind: Literal["cosine"]
    exponent: float = Field(ge=0, le=1000, description="the exponent q of the power pattern")


class GaussianBeam(Directive):
    r"""Field pattern :math:`e^{-\psi^2/2\sigma^2}` off the axis [Eq. (4-1), corrected]."""

    kind: Literal["gaussian_beam"]
    sigma_rad: float = Field(
        gt=0, le=math.pi, description="the standard width of the field pattern [rad]"
    )


class Horn(Directive):
    """A horn of a given gain."""

    kind: Literal["horn"]
    gain_dbi: float = Field(ge=0, le=60, description="the gain on the axis over isotropic [dB]")


Antenna = Annotated[Isotropic | Cosine | GaussianBeam | Horn, Field(discriminator="kind")]
