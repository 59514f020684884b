"""Multistatic antennas: separate receivers, on an arc or anywhere, and their transmitters.

What a bistatic measurement is made of. The arms of a bench that carry its horns are not part
of the scene, nor is what leaks from one horn to the other: a measured sweep is calibrated for it.
"""

from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.antenna import Antenna
from scenes.schema.directions import unit_vector
from scenes.schema.quantities import Angle, Checked, Position, Size

MOST_PLACES = 65_536
"""Most places of receivers, as many as an array may have elements. [-]"""

Positions = Annotated[
    tuple[Position, ...], Field(strict=False, min_length=1, max_length=MOST_PLACES)
]


class Arc(Checked):
    """Places on a horizontal arc, at equal steps from its start to its stop."""

    kind: Literal["arc"]
    centre_m: Position = Field(description="the centre of the arc [m]")
    radius_m: Size = Field(description="the radius of the arc [m]")
    start_deg: Angle = Field(description="the azimuth of the first place from +x [degree]")
    stop_deg: Angle = Field(description="the azimuth of the last place from +x [degree]")
    points: int = Field(ge=2, le=MOST_PLACES, description="the number of places")

    @model_validator(mode="after")
    def _places_differ(self) -> "Arc":
        turn = abs(self.stop_deg - self.start_deg)
        if not 0 < turn < 360:
            raise PydanticCustomError(
                "arc",
                "from start_deg = {start} to stop_deg = {stop} must be more than 0° and less than "
                "360°, where places coincide; change one of them",
                {"start": self.start_deg, "stop": self.stop_deg},
            )
        return self

    @property
    def positions(self) -> Float[np.ndarray, "places 3"]:
        """The places, in the order of the arc [m]."""
        azimuths = np.linspace(self.start_deg, self.stop_deg, self.points)
        outward = np.array([unit_vector(float(azimuth)) for azimuth in azimuths])
        return np.array(np.asarray(self.centre_m) + self.radius_m * outward)


class Places(Checked):
    """Any places, one after the other."""

    kind: Literal["list"]
    positions_m: Positions = Field(description="the places, each [x, y] or [x, y, z] [m]")

    @property
    def positions(self) -> Float[np.ndarray, "places 3"]:
        """The places [m]."""
        return np.array(self.positions_m, dtype=np.float64)


Receivers = Annotated[Arc | Places, Field(discriminator="kind")]


class Transmitter(Checked):
    """One transmitter that serves all receivers, or one place of it for each of them."""

    position_m: Position | None = Field(None, description="where it stands, for all receivers [m]")
    positions_m: Positions | None = Field(
        None, description="where it stands for each receiver in turn [m]"
    )
    antenna: Antenna | None = Field(None, description="its antenna; without, the receivers'")

    @model_validator(mode="after")
    def _stands_somewhere(self) -> "Transmitter":
        if (self.position_m is None) == (self.positions_m is None):
            given = "both" if self.position_m is not None else "neither"
            raise PydanticCustomError(
                "transmitter",
                "has {given} of position_m and positions_m; give exactly one of them",
                {"given": given},
            )
        return self

    @property
    def positions(self) -> Float[np.ndarray, "places 3"]:
        """Its place, or its places [m]."""
        places = (self.position_m,) if self.positions_m is None else self.positions_m
        return np.array(places, dtype=np.float64)
