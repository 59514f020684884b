from .angle_range_map_2d import angle_range_map, default_angles, default_path_lengths
from .angle_range_map_3d import direction_map
from .music import music_spectrum
from .path import Path, PathSet
from .path_extraction_2d import find_paths
from .path_extraction_3d import find_space_paths
from .relax import extract_paths, refine_paths
from .steering import angle_spectrum, plane_steering, spherical_steering

__all__ = [
    "Path",
    "PathSet",
    "angle_range_map",
    "angle_spectrum",
    "default_angles",
    "default_path_lengths",
    "direction_map",
    "extract_paths",
    "find_paths",
    "find_space_paths",
    "music_spectrum",
    "plane_steering",
    "refine_paths",
    "spherical_steering",
]
