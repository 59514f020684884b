from .echo import simulate_echo
from .multistatic import multistatic_echo, multistatic_scene
from .point_targets import point_echo, point_uplink
from .single_bounce_3d import scattered_in_space, sightlines
from .uplink import simulate_uplink

__all__ = [
    "multistatic_echo",
    "multistatic_scene",
    "point_echo",
    "point_uplink",
    "scattered_in_space",
    "sightlines",
    "simulate_echo",
    "simulate_uplink",
]
