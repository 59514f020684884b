from .channel_2d import PredictedPath, predict_channel, predict_user_channel
from .channel_3d import PredictedSpacePath, predict_channel_in_space
from .wall_reflection import MeasuredGain, excess_db, wall_reflections

__all__ = [
    "MeasuredGain",
    "PredictedPath",
    "PredictedSpacePath",
    "excess_db",
    "predict_channel",
    "predict_channel_in_space",
    "predict_user_channel",
    "wall_reflections",
]
