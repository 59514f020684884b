from .scene_files import exported_files, frozen_facets
from .sionna_scene import stand_back

__all__ = [
    "exported_files",
    "frozen_facets",
    "stand_back",
]
