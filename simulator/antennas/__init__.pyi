from .antenna_pattern import AntennaPattern
from .beam_culling import AntennaGroup, in_reach
from .field_pattern import cosine_power, field_gain, gaussian_beam, horn, horn_beam_width
from .links import Links
from .ports import Pattern, Ports, isotropic

__all__ = [
    "AntennaGroup",
    "AntennaPattern",
    "Links",
    "Pattern",
    "Ports",
    "cosine_power",
    "field_gain",
    "gaussian_beam",
    "horn",
    "horn_beam_width",
    "in_reach",
    "isotropic",
]
