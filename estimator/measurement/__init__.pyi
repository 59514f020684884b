from .calibration import (
    equalise,
    measured_response,
    remove_path,
    subtract_background,
    without_frequencies,
)
from .model import Echo, Measurement, MeasurementError, Uplink, Waves, frequency_step
from .store import is_store, measurement_to_dataset, read_measurement, write_measurement

__all__ = [
    "Echo",
    "Measurement",
    "MeasurementError",
    "Uplink",
    "Waves",
    "equalise",
    "frequency_step",
    "is_store",
    "measured_response",
    "measurement_to_dataset",
    "read_measurement",
    "remove_path",
    "subtract_background",
    "without_frequencies",
    "write_measurement",
]
