from .channel_2d import PredictedPath, predict_channel, predict_user_channel
from .edge_echo import edge_echoes_db
from .wall_reflection import MeasuredGain, excess_db, wall_reflections

__all__ = [
    "MeasuredGain",
    "PredictedPath",
    "edge_echoes_db",
    "excess_db",
    "predict_channel",
    "predict_user_channel",
    "wall_reflections",
]
