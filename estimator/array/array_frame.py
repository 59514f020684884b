"""The frame of a linear array: origin at its centre, x along it, y at its boresight."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.measurement.model import MeasurementError

MOST_SLANT = 1e-3
"""Cosine between the boresight that is stated and the array's line, up to which it is rounding:
0.06°. [-]"""

STRAIGHTNESS = 1e-4
"""Largest distance of a phase centre from the array's line. Measured positions depart by their
jitter: 0.1 mm is a phase of 0.6 rad at 300 GHz. Every method uses the positions themselves; only
the frame is that of the line. [m]"""


@dataclass(frozen=True, kw_only=True)
class ArrayFrame:
    """A rigid motion between the world and a linear array's own frame."""

    origin: Float[np.ndarray, " 3"]  # the array's centre in the world [m]
    axes: Float[np.ndarray, "3 3"]  # rows: the array's x, y, z in the world

    def to_local(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Express points of the world in the array's frame. [m]."""
        local: np.ndarray = (points - self.origin) @ self.axes.T
        return local

    def to_world(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Express points of the array's frame in the world. [m]."""
        world: np.ndarray = self.turned_to_world(points) + self.origin
        return world

    def turned_to_world(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Turn vectors of the array's frame into the world's axes."""
        turned: np.ndarray = vectors @ self.axes
        return turned


def array_frame(
    positions: Float[np.ndarray, "positions 3"], boresight: Float[np.ndarray, " 3"]
) -> ArrayFrame:
    """Find the frame of a linear array.

    Parameters
    ----------
    positions
        Phase centres. [m]
    boresight
        Unit vector that the array looks along.

    Raises
    ------
    MeasurementError
        If there is one position only, they do not lie on a line, or the line is not
        perpendicular to the boresight.
    """
    if len(positions) < 2:
        raise MeasurementError(
            "aperture_position: one position has no aperture; angle needs at least two"
        )
    origin = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    _, _, directions = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)
    across = float(np.linalg.norm((positions - origin) @ directions[1:].T, axis=-1).max())
    if across > STRAIGHTNESS:
        raise MeasurementError(
            f"aperture_position: positions lie up to {1e3 * across:.3f} mm off a line, the limit "
            f"is {1e3 * STRAIGHTNESS} mm; mirrors and users are located with a linear array only"
        )
    axis = directions[0] * np.sign(directions[0] @ np.cross(boresight, [0.0, 0.0, 1.0]) or 1.0)
    slant = abs(float(axis @ boresight))
    if slant > MOST_SLANT:
        raise MeasurementError(
            f"boresight: {np.degrees(np.arccos(slant)):.2f}° from the array's axis; it must be "
            "perpendicular to it (90°)"
        )
    ahead = boresight - (boresight @ axis) * axis  # exactly perpendicular, though it was rounded
    ahead = ahead / np.linalg.norm(ahead)
    return ArrayFrame(origin=origin, axes=np.stack([axis, ahead, np.cross(axis, ahead)]))
