"""Directions in the plane z = 0, by their azimuth from +x, counter-clockwise."""

import math

import numpy as np
from jaxtyping import Float


def unit_vector(azimuth_deg: float) -> Float[np.ndarray, " 3"]:
    """Return the horizontal unit vector at an azimuth given in degrees.

    Multiples of 90° are exact, so that an array along x has no y component of 1e-17.
    """
    quarter, rest = divmod(azimuth_deg + 45.0, 90.0)
    x, y = math.cos(math.radians(rest - 45.0)), math.sin(math.radians(rest - 45.0))
    for _ in range(int(quarter) % 4):
        x, y = -y, x
    return np.array([x, y, 0.0]) + 0.0  # turns -0.0 into 0.0


def left_of(direction: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Turn a horizontal vector by +90° about z."""
    return np.array([-direction[1], direction[0], 0.0]) + 0.0


def right_of(direction: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Turn a horizontal vector by -90° about z: the normal of a line cell that runs along it."""
    return np.array([direction[1], -direction[0], 0.0]) + 0.0
