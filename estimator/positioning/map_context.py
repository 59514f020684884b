"""What the echo told of the room that a user's paths are placed in."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_2d import Wall


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """What is known of the room, in the array's frame."""

    walls: tuple[Wall, ...]  # mirrors at their true place
    wall_covariance: Float[np.ndarray, "parameters parameters"]  # of all walls' (angle, offset)
    resolution: Resolution  # of the image: how well it tells where a wall ends
    imaged: bool  # whether there was an echo: without, nothing is known of mirrors
    unassigned_peaks: Float[
        np.ndarray, "peaks 3"
    ]  # peaks of the image on no wall, strongest first [m]
    reach: float  # how far the image shows what there is [m]
    widest: float  # sine of the angle from boresight to which it does [-]
    contrast: float  # intensity of the brightest in the image over its background [-]
