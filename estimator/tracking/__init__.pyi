from .constant_velocity import State, acceleration_noise, moved, smoothed, updated
from .multi_hypothesis import Fix, Track, TrackPoint, fix, predicted, track

__all__ = [
    "Fix",
    "State",
    "Track",
    "TrackPoint",
    "acceleration_noise",
    "fix",
    "moved",
    "predicted",
    "smoothed",
    "track",
    "updated",
]
