from .making import make_part
from .recipe import TRACKS, Recipe, load_recipe
from .reference_methods import METHODS, predict
from .scoring import score

__all__ = ["METHODS", "TRACKS", "Recipe", "load_recipe", "make_part", "predict", "score"]
