from .chain_count import Sees, check_chains
from .diffuse_echo_3d import diffuse_echo
from .diffuse_field_3d import diffuse_wave
from .frequency_interpolation import nodes_for_chain
from .multibounce_2d import SeveralProgress, ghost_echo, untold, uplink_over_surfaces
from .multibounce_3d import coherent_echo, echo_over_mirrors

__all__ = [
    "Sees",
    "SeveralProgress",
    "check_chains",
    "coherent_echo",
    "diffuse_echo",
    "diffuse_wave",
    "echo_over_mirrors",
    "ghost_echo",
    "nodes_for_chain",
    "untold",
    "uplink_over_surfaces",
]
