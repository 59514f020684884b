"""Tables of time-domain data: traces over time, and beat signals of an FMCW chirp."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mmslam.formats.tables.sources import Name
from scenes.schema.quantities import Checked

Band = Annotated[list[float], Field(min_length=2, max_length=2)]


class TimeTable(Checked):
    """Traces over time (impulse radar, GPR, THz-TDS, gprMax): real, or complex about a carrier."""

    unit: Literal["s", "ms", "us", "ns", "ps", "fs"] = Field(
        description='the unit of the numbers, as "ns"'
    )
    variable: Name | None = Field(default=None, description="the variable or column of the times")
    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    step: Annotated[float, Field(gt=0)] | None = Field(
        default=None, description="from each sample to the next, in `unit`"
    )
    first: float = Field(default=0.0, description="the time of the first sample, in `unit`")
    zero: float = Field(
        default=0.0,
        description="when the pulse left the antenna, in `unit`; delays are counted from there",
    )
    band_ghz: Band = Field(description="the lowest and highest frequency that is kept [GHz]")
    carrier_ghz: float = Field(
        default=0.0, description="of complex traces: the frequency that they were mixed down by"
    )

    @model_validator(mode="after")
    def _one_source(self) -> "TimeTable":
        if (self.variable or self.file) and (self.step is not None or self.first != 0.0):
            raise ValueError("give either variable (or a .npy file), or step and first")
        if not 0 <= self.band_ghz[0] < self.band_ghz[1]:
            raise ValueError("band_ghz must rise: give the lowest and the highest frequency")
        return self

    def is_named(self) -> bool:
        """Tell whether a variable or a file holds the times."""
        return self.variable is not None or self.file is not None


class ChirpTable(Checked):
    """Beats of a frequency-modulated continuous wave, sampled while the chirp runs."""

    start_ghz: float = Field(description="the frequency at which the chirp begins [GHz]")
    slope_mhz_per_us: float = Field(description="by how much it rises; negative: it falls")
    sample_rate_msps: Annotated[float, Field(gt=0)] = Field(
        description="samples per microsecond of the converter"
    )
    adc_start_us: float = Field(
        default=0.0, description="from the chirp's begin to the first sample"
    )

    @model_validator(mode="after")
    def _it_moves(self) -> "ChirpTable":
        if self.slope_mhz_per_us == 0:
            raise ValueError("slope_mhz_per_us is 0; a chirp must rise or fall")
        return self
