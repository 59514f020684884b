"""The stepped-frequency radio: its band and its frequencies."""

from typing import Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError
from scipy.constants import speed_of_light

from scenes.schema.quantities import Checked

MOST_POINTS = 100_000
"""Most frequency points; 20 times what the longest sweep of the laboratory has."""


Polarization = Literal["vertical", "horizontal"]
"""Electric field of all antennas: along z, or across z and the direction (in 2-D scenes: TM and TE
of the cross-section)."""


class Radio(Checked):
    """Stepped-frequency radio."""

    start_ghz: float = Field(ge=0.1, le=3000, description="the first frequency [GHz]")
    stop_ghz: float = Field(ge=0.1, le=3000, description="the last frequency [GHz]")
    points: int = Field(ge=2, le=MOST_POINTS, description="the number of frequencies")
    polarization: Polarization = Field(
        default="vertical",
        description="electric field of all antennas, along z or across it (2-D scenes only)",
    )

    @model_validator(mode="after")
    def _a_band(self) -> "Radio":
        if self.stop_ghz <= self.start_ghz:
            raise PydanticCustomError(
                "band",
                "stop_ghz = {stop} must exceed start_ghz = {start}; swap or widen them",
                {"start": self.start_ghz, "stop": self.stop_ghz},
            )
        return self

    @property
    def frequencies(self) -> Float[np.ndarray, " freqs"]:
        """Uniform grid from start to stop [Hz]."""
        return np.linspace(self.start_ghz * 1e9, self.stop_ghz * 1e9, self.points)

    @property
    def centre_frequency(self) -> float:
        """Middle of the band [Hz]."""
        return 0.5e9 * (self.start_ghz + self.stop_ghz)

    @property
    def shortest_wavelength(self) -> float:
        """Wavelength at the highest frequency [m]."""
        return speed_of_light / (self.stop_ghz * 1e9)

    @property
    def longest_wavelength(self) -> float:
        """Wavelength at the lowest frequency [m]."""
        return speed_of_light / (self.start_ghz * 1e9)
