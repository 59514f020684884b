from .map_2d import build_room_map, mirrors_in_world, targets_in_world
from .map_3d import SpaceMap, build_space_map, corrected_values
from .map_images import room_images

__all__ = [
    "SpaceMap",
    "build_room_map",
    "build_space_map",
    "corrected_values",
    "mirrors_in_world",
    "room_images",
    "targets_in_world",
]
