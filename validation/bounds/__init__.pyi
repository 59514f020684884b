from .cramer_rao import cramer_rao_bound
from .no_bound import NoBound
from .position_bound import (
    Plane,
    PositionBound,
    image_and_slopes,
    plane_axes,
    position_error_bound,
    spherical_waves,
)
from .scenario_bound import scenario_position_bound, user_waves
from .wall_bound import (
    line_covariance,
    noise_depth_deviation,
    speckle_depth_deviation,
    wall_covariance_bound,
)

__all__ = [
    "NoBound",
    "Plane",
    "PositionBound",
    "cramer_rao_bound",
    "image_and_slopes",
    "line_covariance",
    "noise_depth_deviation",
    "plane_axes",
    "position_error_bound",
    "scenario_position_bound",
    "speckle_depth_deviation",
    "spherical_waves",
    "user_waves",
    "wall_covariance_bound",
]
