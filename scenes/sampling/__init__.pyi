from .distributions import (
    Choice,
    Grid,
    InBox,
    InPolygon,
    Listed,
    LogUniform,
    Normal,
    Uniform,
    UniformInteger,
)
from .drawn_parameters import Parameter
from .frozen_rooms import Rooms, RoomSpace, first_sample, room_number
from .sample_space import Attempt, SampleSpace, impossible_sample, open_sample_space
from .variations import Variations, load_variations

__all__ = [
    "Attempt",
    "Choice",
    "Grid",
    "InBox",
    "InPolygon",
    "Listed",
    "LogUniform",
    "Normal",
    "Parameter",
    "RoomSpace",
    "Rooms",
    "SampleSpace",
    "Uniform",
    "UniformInteger",
    "Variations",
    "first_sample",
    "impossible_sample",
    "load_variations",
    "open_sample_space",
    "room_number",
]
