"""An image as a function of points: the echo is focused wherever it is asked for."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Complex, Float

from estimator.imaging.backprojection import Focuser, focus

Focus = Callable[[Float[np.ndarray, "*grid 3"]], Complex[np.ndarray, "*grid"]]
"""Focuses the echo on points."""


def focus_within(focuser: Focuser, farthest: float) -> Focus:
    """Return a function that focuses an echo on points of any grid.

    Parameters
    ----------
    focuser
        The prepared echo, in the array's frame.
    farthest
        Distance up to which ranges are unambiguous; the image is 0 beyond. [m]
    """

    def focused(points: Float[np.ndarray, "*grid 3"]) -> Complex[np.ndarray, "*grid"]:
        inside = np.einsum("...x,...x->...", points, points) < farthest**2
        if np.all(inside):
            return focus(focuser, points)
        values = np.zeros(points.shape[:-1], dtype=np.complex128)
        values[inside] = focus(focuser, points[inside])
        return values

    return focused
