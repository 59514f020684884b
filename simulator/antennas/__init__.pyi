from .antenna_pattern import AntennaPattern
from .beam_culling import AntennaGroup, in_reach
from .field_pattern import cosine_power, field_gain, gaussian_beam, horn, horn_beam_width
from .links import Links
from .polarization import VERTICAL, Polarization, antenna_polarization, field_vector
from .ports import Pattern, Ports, isotropic

__all__ = [
    "VERTICAL",
    "AntennaGroup",
    "AntennaPattern",
    "Links",
    "Pattern",
    "Polarization",
    "Ports",
    "antenna_polarization",
    "cosine_power",
    "field_gain",
    "field_vector",
    "gaussian_beam",
    "horn",
    "horn_beam_width",
    "in_reach",
    "isotropic",
]
