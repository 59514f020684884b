"""The roughness of a surface: rms height, correlation length and spectrum."""

from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.quantities import Checked

Spectrum = Literal["gaussian", "exponential"]

LARGEST_RELATIVE_RMS = 0.1
"""Largest rms height over the object's smallest size: at 0.1 four standard deviations still
leave a body. [-]"""


class Roughness(Checked):
    """Statistics of a surface's heights over its mean shape."""

    rms_mm: float = Field(ge=0, le=1000, description="the rms height [mm]")
    correlation_mm: float = Field(
        gt=0, le=1e6, description="the length at which the correlation has fallen to 1/e [mm]"
    )
    spectrum: Spectrum = Field("gaussian", description="'gaussian' or 'exponential'")
    inner_cutoff_mm: float | None = Field(
        None,
        gt=0,
        description="the length below which an exponential surface is smooth [mm]",
    )

    @model_validator(mode="after")
    def _cutoff_where_slopes_are_unbounded(self) -> "Roughness":
        cutoff = self.inner_cutoff_mm
        if self.spectrum == "gaussian" and cutoff is not None:
            raise PydanticCustomError(
                "inner_cutoff",
                "a gaussian spectrum takes no inner_cutoff_mm (it is {cutoff}); remove it, or "
                "set spectrum = 'exponential'",
                {"cutoff": cutoff},
            )
        if self.spectrum == "exponential" and cutoff is None:
            raise PydanticCustomError(
                "inner_cutoff",
                "an exponential spectrum has unbounded slopes; give inner_cutoff_mm, the length "
                "below which the surface is smooth (say, a tenth of correlation_mm)",
            )
        if cutoff is not None and cutoff > self.correlation_mm:
            raise PydanticCustomError(
                "inner_cutoff",
                "inner_cutoff_mm = {cutoff} must not exceed correlation_mm = {length}; lower it",
                {"cutoff": cutoff, "length": self.correlation_mm},
            )
        return self

    @property
    def rms(self) -> float:
        """Root mean square of the heights [m]."""
        return self.rms_mm * 1e-3

    @property
    def correlation_length(self) -> float:
        """Length at which the correlation has fallen to 1/e [m]."""
        return self.correlation_mm * 1e-3

    @property
    def inner_cutoff(self) -> float:
        """Length below which an exponential surface is smooth; 0 where none is needed [m]."""
        return 0.0 if self.inner_cutoff_mm is None else self.inner_cutoff_mm * 1e-3
