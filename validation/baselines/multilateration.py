"""Positions from distances: least squares, with or without the user's clock."""

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

REACH = 2.5
"""Half width of the square around the anchors in which positions are searched: larger than the
rooms compared. [m]"""
STARTS = 4
"""Starting points of the descent along each side of the square. [-]"""
CONVERGED = 1e-12
"""Relative change of position, or of cost, that ends a descent: far below any error. [-]"""


def multilaterate(
    anchors: Float[np.ndarray, "anchors 2"],
    distances: Float[np.ndarray, " anchors"],
    *,
    clock_known: bool = True,
    relative: bool = False,
) -> Float[np.ndarray, " 2"]:
    """Return the least-squares position at given distances from anchors. [m].

    Parameters
    ----------
    anchors
        [m]
    distances
        [m]
    clock_known
        If not, all distances have the same unknown offset, which is estimated too.
    relative
        Whether the distances' relative errors are equal, as for ranging by signal strength.
    """
    anchors, centre = np.asarray(anchors), np.mean(anchors, axis=0)

    def residuals(place: Float[np.ndarray, " n"]) -> Float[np.ndarray, " anchors"]:
        lengths = np.linalg.norm(place[:2] - anchors, axis=-1)
        if relative:
            return np.asarray(np.log(lengths / distances))
        left = lengths - distances
        return np.asarray(left if clock_known else left - left.mean())

    side = np.linspace(-REACH, REACH, STARTS)
    fits = [
        least_squares(residuals, centre + np.array([x, y]), xtol=CONVERGED, ftol=CONVERGED)
        for x in side
        for y in side
    ]
    return np.asarray(min(fits, key=lambda fit: float(fit.cost)).x)
