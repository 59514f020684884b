from .path_covariance import input_covariance, polar_slopes, rests_on
from .path_tracing_2d import project
from .path_tracing_3d import (
    SpaceProjection,
    central_slopes,
    folded_over,
    project_in_space,
    slopes_by_wall,
)
from .specular_chains_2d import image_over, possible_chains, seen_over, unfolded
from .specular_chains_3d import (
    chains_in_space,
    image_in_space,
    seen_over_in_space,
    unfolded_in_space,
)
from .wall_2d import Wall, crossing, mirrored, unit_normal
from .wall_3d import PlaneWall, hidden_by, mirrored_about, within

__all__ = [
    "PlaneWall",
    "SpaceProjection",
    "Wall",
    "central_slopes",
    "chains_in_space",
    "crossing",
    "folded_over",
    "hidden_by",
    "image_in_space",
    "image_over",
    "input_covariance",
    "mirrored",
    "mirrored_about",
    "polar_slopes",
    "possible_chains",
    "project",
    "project_in_space",
    "rests_on",
    "seen_over",
    "seen_over_in_space",
    "slopes_by_wall",
    "unfolded",
    "unfolded_in_space",
    "unit_normal",
    "within",
]
