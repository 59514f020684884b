"""Noise of the receiver."""

import math

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError
from scipy.constants import Boltzmann

from scenes.schema.quantities import Checked

ROOM_TEMPERATURE = 290.0
"""Of the thermal noise that a noise figure is over (IEEE's standard). [K]"""

FLOOR = ("figure_db", "bandwidth_hz", "transmit_power_dbm")


class Noise(Checked):
    """Thermal noise: by its ratio to the signal, or by an absolute noise floor kTBF."""

    snr_db: float = Field(
        float("inf"), ge=-60, allow_inf_nan=True, description="the signal-to-noise ratio [dB]"
    )
    figure_db: float | None = Field(
        None, ge=0, le=60, description="the receiver's noise figure, in place of snr_db [dB]"
    )
    bandwidth_hz: float | None = Field(
        None,
        gt=0,
        le=1e12,
        description="the bandwidth of each sample: of the receiver's filter [Hz]",
    )
    transmit_power_dbm: float | None = Field(
        None, ge=-100, le=100, description="the power of array and users alike [dBm]"
    )

    @model_validator(mode="after")
    def _relative_or_absolute(self) -> "Noise":
        missing = [key for key in FLOOR if getattr(self, key) is None]
        if len(missing) == len(FLOOR):
            return self
        if missing:
            raise PydanticCustomError(
                "floor",
                "a floor needs figure_db, bandwidth_hz and transmit_power_dbm; give {missing}",
                {"missing": " and ".join(missing)},
            )
        if math.isfinite(self.snr_db):
            raise PydanticCustomError(
                "floor",
                "snr_db = {snr_db} and figure_db = {figure_db} exclude each other; remove one",
                {"snr_db": self.snr_db, "figure_db": self.figure_db},
            )
        return self

    @property
    def floor(self) -> float | None:
        """Noise variance over transmit power, kTBF/P; None: relative to the signal. [-]."""
        if self.figure_db is None or self.bandwidth_hz is None or self.transmit_power_dbm is None:
            return None
        sent = 1e-3 * 10 ** (self.transmit_power_dbm / 10)
        thermal = Boltzmann * ROOM_TEMPERATURE * self.bandwidth_hz
        return thermal * 10 ** (self.figure_db / 10) / sent
