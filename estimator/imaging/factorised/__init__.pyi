from .any_points import factorised_backproject, factorised_focus
from .parts import PolarGrid
from .polar_image import focus_polar

__all__ = ["PolarGrid", "factorised_backproject", "factorised_focus", "focus_polar"]
