from .hidden_imaging import HiddenImaging, conclude_hidden, draw_hidden, hidden_rows, measure_hidden
from .hidden_user import (
    UserTrial,
    draw_errors,
    draw_map,
    draw_plan,
    first_user,
    map_cuts,
    user_rows,
    wall_rows,
)

__all__ = [
    "HiddenImaging",
    "UserTrial",
    "conclude_hidden",
    "draw_errors",
    "draw_hidden",
    "draw_map",
    "draw_plan",
    "first_user",
    "hidden_rows",
    "map_cuts",
    "measure_hidden",
    "user_rows",
    "wall_rows",
]
