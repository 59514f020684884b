"""The air of a scene: what it is, not what it does to waves."""

from pydantic import Field

from scenes.schema.quantities import Checked


class Air(Checked):
    """The table [air]; without it, waves run in vacuum. An empty table is the air of a room."""

    temperature_c: float = Field(20.0, ge=-80, le=100, description="its temperature [°C]")
    pressure_hpa: float = Field(1013.25, ge=1, le=2000, description="its pressure [hPa]")
    humidity_percent: float = Field(50.0, ge=0, le=100, description="its relative humidity [%]")
    absorption: bool = Field(
        True, description="whether its oxygen and water vapour absorb (1 to 1000 GHz)"
    )
