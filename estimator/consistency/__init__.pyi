from .doubt import Doubted, doubted
from .faulty_samples import Screened, without_faults
from .pilot_curvature import pilot_lateness
from .same_samples import refuse_same_samples
from .stated_heights import height_error
from .time_convention import brighter_conjugated, refuse_other_convention

__all__ = [
    "Doubted",
    "Screened",
    "brighter_conjugated",
    "doubted",
    "height_error",
    "pilot_lateness",
    "refuse_other_convention",
    "refuse_same_samples",
    "without_faults",
]
