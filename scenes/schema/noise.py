"""Noise of the receiver."""

from pydantic import Field

from scenes.schema.quantities import Checked


class Noise(Checked):
    """Thermal noise: SNR of each channel sample, on the mean over the array."""

    snr_db: float = Field(
        float("inf"), ge=-60, allow_inf_nan=True, description="the signal-to-noise ratio [dB]"
    )
