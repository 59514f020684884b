from .channel_2d import PredictedPath, predict_channel, predict_user_channel
from .wall_reflection import MeasuredGain, excess_db, wall_reflections

__all__ = [
    "MeasuredGain",
    "PredictedPath",
    "excess_db",
    "predict_channel",
    "predict_user_channel",
    "wall_reflections",
]
