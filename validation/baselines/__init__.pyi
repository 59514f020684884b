from .angle_difference import from_differences
from .arrivals import first_arrival, first_sparse_arrival, plane_wave_angle, strength_db
from .fingerprinting import nearest
from .multiband_toa import in_channels
from .multilateration import multilaterate
from .room import Anchor, Baseline, Room
from .rssi_ranging import path_loss
from .scatterer_paths import BouncePath, departure, intersect, user_array

__all__ = [
    "Anchor",
    "Baseline",
    "BouncePath",
    "Room",
    "departure",
    "first_arrival",
    "first_sparse_arrival",
    "from_differences",
    "in_channels",
    "intersect",
    "multilaterate",
    "nearest",
    "path_loss",
    "plane_wave_angle",
    "strength_db",
    "user_array",
]
