from .facet_spacing import facet_count, mesh_facet_count, steps, steps_round
from .height_synthesis import rough_profile, rough_sheet
from .heights import Heights
from .level_of_detail import flat_and_smooth
from .mesh_refinement import mesh_is_closed, mesh_surface, refined
from .mesh_section_2d import lines_are_closed, mesh_lines, mesh_segments
from .primitives import in_reach, shape_in_reach, upright_shape
from .shape import grid_triangles
from .tiled_faces import Reach

__all__ = [
    "Heights",
    "Reach",
    "facet_count",
    "flat_and_smooth",
    "grid_triangles",
    "in_reach",
    "lines_are_closed",
    "mesh_facet_count",
    "mesh_is_closed",
    "mesh_lines",
    "mesh_segments",
    "mesh_surface",
    "refined",
    "rough_profile",
    "rough_sheet",
    "shape_in_reach",
    "steps",
    "steps_round",
    "upright_shape",
]
