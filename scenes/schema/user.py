"""Users: transmitters whose position is to be estimated."""

import numpy as np
from jaxtyping import Float
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.antenna import Antenna, Directive, Isotropic
from scenes.schema.quantities import Checked, Position


class User(Checked):
    """A user that sends a pilot."""

    position_m: Position = Field(description="the position of the user [m]")
    antenna: Antenna = Field(default_factory=Isotropic, description="the user's antenna")

    @model_validator(mode="after")
    def _a_directive_antenna_looks_somewhere(self) -> "User":
        if isinstance(self.antenna, Directive) and not self.antenna.aims:
            raise PydanticCustomError(
                "aims",
                "a directive antenna must look somewhere; give antenna.aim (the name of an "
                "object), antenna.aim_m (a point) or antenna.aim_deg (an azimuth)",
            )
        return self

    @property
    def position(self) -> Float[np.ndarray, " 3"]:
        """Where the user is [m]."""
        return np.array(self.position_m, dtype=np.float64)
