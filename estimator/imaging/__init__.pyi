from .backprojection import backproject, focus, focus_uplink, prepare
from .factorised import factorised_backproject
from .focusing import Focus, focus_within
from .peak_detection import mean_background
from .range_compression import RangeProfiles, range_profiles, unambiguous_path
from .range_gating import gated
from .survey_2d import Survey, survey
from .survey_3d import VolumeSurvey, lobe_origins, survey_volume

__all__ = [
    "Focus",
    "RangeProfiles",
    "Survey",
    "VolumeSurvey",
    "backproject",
    "factorised_backproject",
    "focus",
    "focus_uplink",
    "focus_within",
    "gated",
    "lobe_origins",
    "mean_background",
    "prepare",
    "range_profiles",
    "survey",
    "survey_volume",
    "unambiguous_path",
]
