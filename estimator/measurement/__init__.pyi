from .air import Air
from .calibration import (
    equalise,
    measured_response,
    remove_path,
    subtract_background,
    without_frequencies,
)
from .constant_signal import SharedSignal, shared_signal, without_delays, without_shared_signal
from .delay_by_focus import FocusDelay, focus_delay
from .frequency_resampling import EqualSteps, to_equal_steps
from .model import Echo, Measurement, MeasurementError, Uplink, Waves, frequency_step
from .path_list import PathList
from .store import is_store, measurement_to_dataset, read_measurement, write_measurement

__all__ = [
    "Air",
    "Echo",
    "EqualSteps",
    "FocusDelay",
    "Measurement",
    "MeasurementError",
    "PathList",
    "SharedSignal",
    "Uplink",
    "Waves",
    "equalise",
    "focus_delay",
    "frequency_step",
    "is_store",
    "measured_response",
    "measurement_to_dataset",
    "read_measurement",
    "remove_path",
    "shared_signal",
    "subtract_background",
    "to_equal_steps",
    "without_delays",
    "without_frequencies",
    "without_shared_signal",
    "write_measurement",
]
