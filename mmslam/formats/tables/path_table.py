"""Lists of paths, as channel sounders give them: directions, delays and levels."""

from typing import Annotated, Literal

from pydantic import Field

from mmslam.formats.tables.sources import TIME_UNITS, Name
from scenes.schema.quantities import Checked

Positive = Annotated[float, Field(gt=0)]


class PathTable(Checked):
    """A row or entry for each path, at the base station; of several places of the user."""

    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    place: Name | None = Field(
        default=None,
        description="the variable or column that tells places of the user apart; left out, all "
        "paths are of one place, or each row of a matrix is a place",
    )
    azimuth: Name = Field(description="the variable or column of the azimuths")
    elevation: Name | None = Field(
        default=None, description="the variable or column of the elevations"
    )
    angle_unit: Literal["deg", "rad"] = Field(default="deg", description="the unit of angles")
    azimuth_zero: Literal["x", "y"] = Field(
        default="x",
        description='"x" or "y": where azimuth 0 points, along the array or its boresight',
    )
    clockwise: bool = Field(
        default=False, description="true: azimuths grow clockwise, seen from above"
    )
    zenith: bool = Field(
        default=False, description="true: elevations are counted from straight above"
    )
    delay: Name = Field(description="the variable or column of the delays")
    delay_unit: Literal["s", "ms", "us", "ns", "ps", "fs"] = Field(
        default="ns", description="the unit of delays"
    )
    power_db: Name | None = Field(
        default=None, description="the variable or column of the levels [dB] or [dBm]"
    )
    power_offset_db: float = Field(
        default=0.0,
        description="what is added to levels to make them received over transmitted power of "
        "isotropic antennas: minus the transmitted power [dBm] and both antennas' gains [dBi]",
    )
    frequency_ghz: Positive | None = Field(
        default=None,
        description="the band's centre, if levels are calibrated so; only then can a direct path "
        "be told from a reflected one",
    )
    angle_deviation_deg: Positive = Field(description="standard deviation of the angles")
    delay_deviation_ns: Positive = Field(description="standard deviation of the delays")
    power_deviation_db: Positive = Field(default=1.0, description="standard deviation of levels")

    def seconds(self) -> float:
        """Return the unit of delays. [s]."""
        return 1 / TIME_UNITS[self.delay_unit]
