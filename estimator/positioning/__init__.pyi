from .decision_rules import decide
from .diffuse_fallback import with_diffuse_search
from .diffuse_positioning import search_diffuse
from .map_context import MapContext, no_image
from .wall_anchors import SeenWall
from .weighted_least_squares import Consensus, Sighting, solve_position

__all__ = [
    "Consensus",
    "MapContext",
    "SeenWall",
    "Sighting",
    "decide",
    "no_image",
    "search_diffuse",
    "solve_position",
    "with_diffuse_search",
]
