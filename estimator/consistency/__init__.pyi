from .doubt import Doubted, doubted
from .faulty_samples import Screened, without_faults
from .pilot_curvature import pilot_lateness
from .same_samples import refuse_same_samples
from .stated_heights import height_error

__all__ = [
    "Doubted",
    "Screened",
    "doubted",
    "height_error",
    "pilot_lateness",
    "refuse_same_samples",
    "without_faults",
]
