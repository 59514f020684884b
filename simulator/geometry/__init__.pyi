from .faces import Face, scattering_faces
from .facets import (
    Facets,
    Group,
    Relief,
    is_rough,
    joined,
    profile_surface,
    scene_facets,
    surface_facets,
)
from .mean_surfaces import mean_mirrors, rms_height
from .mirrors import Mirrors, dot, line_mirrors
from .patches import Patches, cut_into_patches, patch_side
from .ray_scene import RayScene, blocked, build_scene, facets_visible

__all__ = [
    "Face",
    "Facets",
    "Group",
    "Mirrors",
    "Patches",
    "RayScene",
    "Relief",
    "blocked",
    "build_scene",
    "cut_into_patches",
    "dot",
    "facets_visible",
    "is_rough",
    "joined",
    "line_mirrors",
    "mean_mirrors",
    "patch_side",
    "profile_surface",
    "rms_height",
    "scattering_faces",
    "scene_facets",
    "surface_facets",
]
