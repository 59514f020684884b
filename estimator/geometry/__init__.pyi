from .bearing import Bearing
from .bearing_2d import LINEAR
from .bearing_3d import PLANAR
from .flat_wall import FlatWall
from .lateness import Lateness, combined
from .path_covariance import input_covariance, polar_slopes, rests_on
from .path_tracing import Projection, project, trace
from .specular_chains import Chain, chain_to, image_over, seen_over, unfolded, unfolded_over
from .specular_chains_2d import possible_chains
from .wall_2d import Wall, crossing, mirrored, unit_normal
from .wall_3d import PlaneWall, hidden_by, mirrored_about, within
from .wall_covariance import joint_covariance, place_covariance

__all__ = [
    "LINEAR",
    "PLANAR",
    "Bearing",
    "Chain",
    "FlatWall",
    "Lateness",
    "PlaneWall",
    "Projection",
    "Wall",
    "chain_to",
    "combined",
    "crossing",
    "hidden_by",
    "image_over",
    "input_covariance",
    "joint_covariance",
    "mirrored",
    "mirrored_about",
    "place_covariance",
    "polar_slopes",
    "possible_chains",
    "project",
    "rests_on",
    "seen_over",
    "trace",
    "unfolded",
    "unfolded_over",
    "unit_normal",
    "within",
]
