from .figures_2d import draw_angle_range_map, draw_close_up, draw_image, draw_localization
from .figures_3d import draw_directions, draw_plan, draw_projection
from .resolution_bars import draw_resolution_bars
from .scenario_plan import draw_scenario, half_power_width, outline, path_style
from .scenario_view import draw_view
from .views import View, estimate_points, view_around

__all__ = [
    "View",
    "draw_angle_range_map",
    "draw_close_up",
    "draw_directions",
    "draw_image",
    "draw_localization",
    "draw_plan",
    "draw_projection",
    "draw_resolution_bars",
    "draw_scenario",
    "draw_view",
    "estimate_points",
    "half_power_width",
    "outline",
    "path_style",
    "view_around",
]
