"""Boresight of an array if none is given: the normal of the area that its positions fill."""

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from estimator.measurement.model import MeasurementError

FLAT = 1e-3
"""Largest thickness of an array in its boresight, over its extent. [-]"""

FILLED = 4.0
"""Largest area of positions for each of them, over the square of the distance of neighbours: 1 of a
square grid, 0.87 of a hexagonal one, 4 of a grid with two steps in the ratio of 4; more on a circle
of more than about ten positions, which encloses an area without filling it. [-]"""


def boresight_of(
    name: str,
    positions: Float[np.ndarray, "positions 3"],
    given: Float[np.ndarray, " 3"] | None,
) -> tuple[Float[np.ndarray, " 3"], str | None]:
    """Return the unit boresight, and a remark if it is neither the given one nor y.

    Parameters
    ----------
    name
        What the positions belong to, for messages.
    positions
        Where the antenna stood. [m]
    given
        The boresight of the mapping; None: none was given, and y is usual.

    Raises
    ------
    MeasurementError
        If the positions fill an area that holds the boresight that was given.
    """
    usual = np.array([0.0, 1.0, 0.0])
    looking = usual if given is None else given / np.linalg.norm(given)
    normal = _normal_of_filled_area(positions)
    if normal is None or abs(normal @ looking) > 0.5:
        return looking, None
    axis = np.round(normal, 3).tolist()
    if given is not None:
        raise MeasurementError(
            f"{name}: boresight = {given.tolist()} lies in the area of the positions, whose normal "
            f"is {axis}; an array looks out of its area: correct boresight, or the axes"
        )
    # The side is not in the positions; the larger component is taken as positive.
    normal = normal * np.sign(normal[np.argmax(np.abs(normal))])
    normal = np.round(normal, 12) / np.linalg.norm(np.round(normal, 12))
    return normal, (
        f"{name}: the positions fill an area in which y lies, so the array cannot look along y: "
        f"boresight = {np.round(normal, 3).tolist()} is taken; set boresight in the mapping if it "
        "looks to the other side"
    )


def _normal_of_filled_area(positions: Float[np.ndarray, "positions 3"]) -> np.ndarray | None:
    if len(positions) < 9:  # 3 × 3: fewer are as well a curve
        return None
    centred = positions - positions.mean(axis=0)
    _, spread, axes = np.linalg.svd(centred, full_matrices=False)
    if spread[1] < FLAT * spread[0] or spread[2] > FLAT * spread[0]:
        return None  # a line, or no plane
    plane = centred @ axes[:2].T
    area = float(np.prod(np.ptp(plane, axis=0)))
    if np.ptp(plane, axis=0).min() == 0:
        return None
    nearest = np.asarray(cKDTree(plane).query(plane, k=2)[0])[:, 1]
    # n positions on a grid have (√n − 1)² cells between them.
    cells = max((np.sqrt(len(positions)) - 1) ** 2, 1.0)
    if area > FILLED * cells * float(np.median(nearest)) ** 2:
        return None
    return np.asarray(axes[2])
