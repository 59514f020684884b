"""The roughness of a surface: by statistics of its heights, or by measured heights."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.errors import ScenarioError
from scenes.schema.height_map import HeightMap, read_height_map
from scenes.schema.quantities import Checked

Spectrum = Literal["gaussian", "exponential", "power_law"]

Distribution = Literal["gaussian", "uniform", "lognormal"]

LARGEST_RELATIVE_RMS = 0.1
"""Largest rms height over the object's smallest size: at 0.1 four standard deviations still
leave a body. [-]"""

SAME = 0.01
"""Difference of a given rms height or correlation length from the file's that is none. [-]"""

SHORTEST_MM = 1e-6
"""Shortest length that a surface has any heights over: a nanometre, some ten atoms. [mm]"""


class Scale(Checked):
    """Statistics of heights with one correlation length."""

    rms_mm: float = Field(ge=0, le=1000, description="the rms height [mm]")
    correlation_mm: float = Field(
        ge=SHORTEST_MM,
        le=1e6,
        description="the length at which the correlation has fallen to 1/e [mm]",
    )
    spectrum: Spectrum = Field("gaussian", description="'gaussian', 'exponential' or 'power_law'")
    hurst_exponent: float | None = Field(
        None,
        gt=0,
        le=1,
        description="the exponent H of a power law: beyond 1/correlation the spectrum of a "
        "surface falls with k^-(2+2H), 0.5 being exponential",
    )
    inner_cutoff_mm: float | None = Field(
        None,
        ge=SHORTEST_MM,
        description="the length below which an exponential surface, or one of a power law, is "
        "smooth [mm]",
    )

    @model_validator(mode="after")
    def _cutoff_where_slopes_are_unbounded(self) -> "Scale":
        cutoff = self.inner_cutoff_mm
        if self.spectrum == "gaussian" and cutoff is not None:
            raise PydanticCustomError(
                "inner_cutoff",
                "a gaussian spectrum takes no inner_cutoff_mm (it is {cutoff}); remove it, or "
                "set spectrum = 'exponential'",
                {"cutoff": cutoff},
            )
        if self.spectrum != "gaussian" and cutoff is None:
            raise PydanticCustomError(
                "inner_cutoff",
                "an {spectrum} spectrum has unbounded slopes; give inner_cutoff_mm, the length "
                "below which the surface is smooth (say, a tenth of correlation_mm)",
                {"spectrum": self.spectrum},
            )
        if cutoff is not None and cutoff > self.correlation_mm:
            raise PydanticCustomError(
                "inner_cutoff",
                "inner_cutoff_mm = {cutoff} must not exceed correlation_mm = {length}; lower it",
                {"cutoff": cutoff, "length": self.correlation_mm},
            )
        if (self.spectrum == "power_law") != (self.hurst_exponent is not None):
            raise PydanticCustomError(
                "hurst",
                "hurst_exponent belongs to spectrum = 'power_law', and that needs it; give both "
                "or none",
            )
        return self

    @property
    def correlation_length(self) -> float:
        """Length at which the correlation has fallen to 1/e [m]."""
        return self.correlation_mm * 1e-3

    @property
    def inner_cutoff(self) -> float:
        """Length below which an exponential surface is smooth; 0 where none is needed [m]."""
        return 0.0 if self.inner_cutoff_mm is None else self.inner_cutoff_mm * 1e-3

    @property
    def hurst(self) -> float:
        """Exponent H of the power law; an exponential spectrum has one half. [-]."""
        return 0.5 if self.hurst_exponent is None else self.hurst_exponent


class Roughness(Scale):
    """A surface's heights over its mean shape: drawn by statistics, or read from a file."""

    profile: Literal["statistics", "file"] = Field(
        "statistics", description="'statistics', or 'file': heights as they were measured"
    )
    second: Scale | None = Field(
        None, description="the table of a second, independent roughness on top of the first"
    )
    height_distribution: Distribution = Field(
        "gaussian", description="'gaussian', 'uniform', or 'lognormal' with a skewness"
    )
    skewness: float | None = Field(
        None, ge=-3, le=3, description="the skewness of lognormal heights, outward positive [-]"
    )
    file: str | None = Field(
        None, min_length=1, description="the file of measured heights: .csv, .npz or .tif"
    )
    step_mm: float | None = Field(
        None, gt=0, le=1000, description="the distance of neighbouring heights in the file [mm]"
    )
    unit_mm: float = Field(1.0, gt=0, le=1000, description="what a 1 in the file stands for [mm]")
    repeat: bool = Field(
        False, description="true: a file smaller than a face is continued by its mirror images"
    )

    @model_validator(mode="before")
    @classmethod
    def _statistics_of_the_file(cls, data: object) -> object:
        """Fill in the rms height and the correlation length of measured heights."""
        if not isinstance(data, Mapping) or data.get("profile") != "file":
            return data
        step, unit = data.get("step_mm"), data.get("unit_mm", 1.0)
        if not isinstance(data.get("file"), str) or not data["file"]:
            raise PydanticCustomError("file", "profile = 'file' needs file; give its path")
        if not isinstance(unit, int | float) or not isinstance(step, int | float | None):
            return data  # the fields' own checks refuse it
        try:
            heights = read_height_map(
                Path(data["file"]),
                step=None if step is None else 1e-3 * step,
                unit=1e-3 * float(unit),
            )
        except ScenarioError as error:
            raise PydanticCustomError("file", "{problem}", {"problem": str(error)}) from None
        found = {"rms_mm": 1e3 * heights.rms, "correlation_mm": 1e3 * heights.correlation_length}
        for key, value in found.items():
            given = data.get(key, value)
            if not isinstance(given, int | float) or abs(given - value) > SAME * value:
                raise PydanticCustomError(
                    "file",
                    "{key} = {given} and the file's is {value}; leave it out: it is the file's",
                    {"key": key, "given": str(given), "value": f"{value:.4g}"},
                )
        return {**data, **found}

    @model_validator(mode="after")
    def _one_source_of_heights(self) -> "Roughness":
        of_file = [key for key in ("file", "step_mm") if getattr(self, key) is not None]
        of_file += ["repeat"] * self.repeat
        if self.profile == "statistics" and of_file:
            raise PydanticCustomError(
                "profile",
                "{keys} belongs to profile = 'file'; set that, or leave it out",
                {"keys": " and ".join(of_file)},
            )
        drawn = self.second is not None or self.height_distribution != "gaussian"
        if self.profile == "file" and (drawn or self.spectrum != "gaussian"):
            raise PydanticCustomError(
                "profile",
                "profile = 'file' takes the heights as they are; leave spectrum, second and "
                "height_distribution out",
            )
        if (self.height_distribution == "lognormal") != (self.skewness not in (None, 0.0)):
            raise PydanticCustomError(
                "skewness",
                "skewness (not 0) belongs to height_distribution = 'lognormal', and that needs it; "
                "give both or none",
            )
        return self

    @property
    def scales(self) -> tuple[Scale, ...]:
        """The statistics that are drawn, one after the other."""
        return (self,) if self.second is None else (self, self.second)

    @property
    def rms(self) -> float:
        """Root mean square of the heights [m]."""
        return math.sqrt(sum((1e-3 * scale.rms_mm) ** 2 for scale in self.scales))

    @property
    def measured(self) -> HeightMap | None:
        """Measured heights; None where they are drawn."""
        if self.file is None:
            return None
        step = None if self.step_mm is None else 1e-3 * self.step_mm
        return read_height_map(Path(self.file), step=step, unit=1e-3 * self.unit_mm)
