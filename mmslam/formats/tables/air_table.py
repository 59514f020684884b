"""The air that was measured in, as a mapping tells it."""

from pydantic import Field

from estimator.measurement.air import LIMITS, ROOM, Air
from scenes.schema.quantities import Checked


class AirTable(Checked):
    """What is left out of it is a room's."""

    temperature_c: float = Field(
        default=ROOM.temperature_c,
        ge=LIMITS["temperature_c"][0],
        le=LIMITS["temperature_c"][1],
        description="its temperature [°C]",
    )
    pressure_hpa: float = Field(
        default=ROOM.pressure_hpa,
        ge=LIMITS["pressure_hpa"][0],
        le=LIMITS["pressure_hpa"][1],
        description="its pressure [hPa]",
    )
    humidity_percent: float = Field(
        default=ROOM.humidity_percent,
        ge=LIMITS["humidity_percent"][0],
        le=LIMITS["humidity_percent"][1],
        description="its relative humidity [%]",
    )

    def air(self) -> Air:
        """Return it as a measurement holds it."""
        return Air(**self.model_dump())
