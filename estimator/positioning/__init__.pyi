from .diffuse_fallback import with_diffuse_search
from .diffuse_positioning import SeenWall, search_diffuse
from .position_decision_2d import decide
from .position_decision_3d import decide_in_space

__all__ = [
    "SeenWall",
    "decide",
    "decide_in_space",
    "search_diffuse",
    "with_diffuse_search",
]
