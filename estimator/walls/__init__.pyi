from .fitted_line import FittedLine
from .line_refinement import refine_by_echo
from .line_relations import lies_on, unassigned_peaks
from .plane_fit import FittedPlane, plane_axes, towards_array
from .wall_detection_2d import detect_mirrors
from .wall_detection_3d import detect_planes, lobe_of_a_wall

__all__ = [
    "FittedLine",
    "FittedPlane",
    "detect_mirrors",
    "detect_planes",
    "lies_on",
    "lobe_of_a_wall",
    "plane_axes",
    "refine_by_echo",
    "towards_array",
    "unassigned_peaks",
]
