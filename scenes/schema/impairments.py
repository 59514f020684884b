"""Hardware impairments of the radio, beyond thermal noise; each is off unless given."""

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from scenes.schema.quantities import Checked


class Impairments(Checked):
    """The table [impairments]; a key that is left out, or 0, does nothing."""

    phase_noise_deg: float = Field(0.0, ge=0, le=360, description="the rms phase [degree]")
    phase_noise_samples: float = Field(
        0.0,
        ge=0,
        le=1e9,
        description="the samples after which the phase is forgotten (to 1/e), 0 for white noise",
    )
    gain_ripple_db: float = Field(
        0.0, ge=0, le=6, description="how far the gain rises at a crest over frequency [dB]"
    )
    gain_ripple_ghz: float | None = Field(
        None, gt=0, le=1000, description="the period of the ripple over frequency [GHz]"
    )
    position_jitter_mm: float = Field(
        0.0, ge=0, le=10, description="the rms of the elements' positions along each axis [mm]"
    )
    clock_offset_ns: float = Field(
        0.0, ge=-1e6, le=1e6, description="the users' clock minus the base station's [ns]"
    )
    clock_known: bool = Field(
        True, description="whether the estimator is told clock_offset_ns: true or false"
    )
    dynamic_range_db: float | None = Field(
        None, gt=0, le=400, description="strongest sample over the rounding error [dB]"
    )

    @model_validator(mode="after")
    def _what_belongs_together(self) -> "Impairments":
        if self.gain_ripple_db > 0 and self.gain_ripple_ghz is None:
            raise PydanticCustomError(
                "gain_ripple",
                "gain_ripple_db = {peak} needs a period; give gain_ripple_ghz (say, 1.5: a "
                "round trip of 20 cm)",
                {"peak": self.gain_ripple_db},
            )
        if self.phase_noise_samples > 0 and self.phase_noise_deg == 0:
            raise PydanticCustomError(
                "phase_noise",
                "phase_noise_samples = {samples} has no phase to correlate; give "
                "phase_noise_deg, or leave it out",
                {"samples": self.phase_noise_samples},
            )
        return self

    @property
    def position_jitter(self) -> float:
        """Standard deviation of the elements' positions along each axis [m]."""
        return self.position_jitter_mm * 1e-3

    @property
    def clock_offset(self) -> float:
        """The users' clock minus the base station's [s]."""
        return self.clock_offset_ns * 1e-9
