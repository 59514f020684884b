from .ghost_correction import corrected_image
from .map_2d import build_room_map, mirrors_in_world, targets_in_world
from .map_3d import SpaceMap, build_space_map
from .map_images import images_on
from .map_images_2d import room_images
from .map_images_3d import space_images

__all__ = [
    "SpaceMap",
    "build_room_map",
    "build_space_map",
    "corrected_image",
    "images_on",
    "mirrors_in_world",
    "room_images",
    "space_images",
    "targets_in_world",
]
