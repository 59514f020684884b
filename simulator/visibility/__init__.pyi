from .line_of_sight import in_line_of_sight
from .mutual_visibility import MutualVisibility, facets_see_each_other
from .seen import Seen
from .shaft_culling import Sightlines, object_shape, scenario_obstacles

__all__ = [
    "MutualVisibility",
    "Seen",
    "Sightlines",
    "facets_see_each_other",
    "in_line_of_sight",
    "object_shape",
    "scenario_obstacles",
]
