"""The frequencies of a stepped sweep."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mmslam.formats.tables.sources import Name
from scenes.schema.quantities import Checked


class FrequencyTable(Checked):
    """The frequencies of array and CSV files (a Touchstone file says its own)."""

    unit: Literal["Hz", "kHz", "MHz", "GHz", "THz"] = Field(
        description='the unit of the numbers, as "GHz"'
    )
    variable: Name | None = Field(default=None, description="its variable or column")
    file: Name | None = Field(default=None, description="its file, if it is not SOURCE")
    start: float | None = Field(default=None, description="the first frequency, in `unit`")
    stop: float | None = Field(default=None, description="the last frequency, in `unit`")
    points: Annotated[int, Field(ge=2)] | None = Field(
        default=None, description="the number of frequencies, at least 2"
    )

    @model_validator(mode="after")
    def _one_source(self) -> "FrequencyTable":
        span = (self.start, self.stop, self.points)
        named = self.variable is not None or self.file is not None
        if named == any(one is not None for one in span):
            raise ValueError("give either variable (or a .npy file), or start, stop and points")
        if not named and None in span:
            raise ValueError("start, stop and points belong together; give all three")
        return self
