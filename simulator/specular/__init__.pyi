from .diffuse_chains import DiffuseLeg, diffuse_legs, may_reach
from .free_space import direct_wave
from .image_method import Blocked, Chain, find_chains, trace_chain, unfolded_chain
from .image_sources import Leg, LegReflection, legs_within_reach
from .path_field import reflected_field, roughness_loss, specular_response
from .ray_launching import launched_sequences

__all__ = [
    "Blocked",
    "Chain",
    "DiffuseLeg",
    "Leg",
    "LegReflection",
    "diffuse_legs",
    "direct_wave",
    "find_chains",
    "launched_sequences",
    "legs_within_reach",
    "may_reach",
    "reflected_field",
    "roughness_loss",
    "specular_response",
    "trace_chain",
    "unfolded_chain",
]
