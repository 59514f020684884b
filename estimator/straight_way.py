"""What may turn a ray that seems to go straight: mirrors that the image does not show as such.

A wall too smooth to scatter echoes from its two ends alone, and reflects all the better; a short
one shows as a few peaks without a direction. No measurement of the user's pilot can tell its
image in such a mirror from the user.
"""

import numpy as np
from jaxtyping import Float

from estimator.projection import Wall, crossing

LOOSE_PEAKS = 12
"""Strongest loose peaks between which an unseen wall is suspected."""
BESIDE = 2.0
"""Cells beside a ray within which a peak stands on it. [-]."""
USER_SIZE = 0.05
"""How far before the end of a path the user itself may echo. [m]."""


def unseen_mirror(
    aoa: float, path_length: float, loose: Float[np.ndarray, "peaks 3"]
) -> Wall | None:
    """Return a wall between two loose points that the ray meets before its end, if there is one.

    Parameters
    ----------
    aoa, path_length
        Of the ray from the origin. [rad], [m]
    loose
        Peaks of the image that lie on no wall, strongest first. [m]
    """
    points = loose[:LOOSE_PEAKS]
    towards = np.array([np.cos(aoa), np.sin(aoa), 0.0])
    for first, second in zip(*np.triu_indices(len(points), k=1), strict=True):
        hit = crossing(np.zeros(3), towards, points[first], points[second])
        if hit is not None and hit[0] < path_length:
            return Wall(start=points[first], end=points[second], covariance=np.zeros((2, 2)))
    return None


def what_stands_in_the_way(
    aoa: float, path_length: float, loose: Float[np.ndarray, "peaks 3"], cell: float
) -> Float[np.ndarray, " 3"] | None:
    """Return the strongest loose point that stands on the ray before its end, if there is one.

    Parameters
    ----------
    aoa, path_length
        Of the ray from the origin. [rad], [m]
    loose
        Peaks of the image that lie on no wall, strongest first. [m]
    cell
        Resolution of the image across a ray, as an angle. [rad]
    """
    if not len(loose):
        return None
    towards = np.array([np.cos(aoa), np.sin(aoa), 0.0])
    ahead = loose @ towards
    beside = np.linalg.norm(loose - ahead[:, None] * towards, axis=-1)
    on_it = (ahead > 0) & (ahead < path_length - USER_SIZE) & (beside < BESIDE * cell * ahead)
    return loose[int(np.argmax(on_it))] if on_it.any() else None
