from .air import RadioInMedium, in_air, longest_path
from .array_antennas import array_group, in_space, sending_group, user_group
from .level_of_detail import mirrored_bodies
from .radio_scene import RadioScene, antenna_pattern, facet_ports, scenario_materials, true_elements
from .scenario_paths import ScenarioPath
from .scene_mirrors import SceneMirrors
from .truth import scenario_truth
from .unambiguous_range import range_notes

__all__ = [
    "RadioInMedium",
    "RadioScene",
    "ScenarioPath",
    "SceneMirrors",
    "antenna_pattern",
    "array_group",
    "facet_ports",
    "in_air",
    "in_space",
    "longest_path",
    "mirrored_bodies",
    "range_notes",
    "scenario_materials",
    "scenario_truth",
    "sending_group",
    "true_elements",
    "user_group",
]
