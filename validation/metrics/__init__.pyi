from .coverage import consistency, normalised_square, position_errors
from .errors import (
    ErrorSummary,
    WallError,
    distances_from_segment,
    error_summary,
    nearest_wall,
    position_error,
    wall_error,
    wall_errors,
)
from .image_quality import image_entropy, main_lobe, sidelobe_ratios
from .point_response import PeakCut, peak_cut
from .target_association import associate, compare_targets
from .truth import Truth, front_face, read_truth, truth_from_dataset

__all__ = [
    "ErrorSummary",
    "PeakCut",
    "Truth",
    "WallError",
    "associate",
    "compare_targets",
    "consistency",
    "distances_from_segment",
    "error_summary",
    "front_face",
    "image_entropy",
    "main_lobe",
    "nearest_wall",
    "normalised_square",
    "peak_cut",
    "position_error",
    "position_errors",
    "read_truth",
    "sidelobe_ratios",
    "truth_from_dataset",
    "wall_error",
    "wall_errors",
]
