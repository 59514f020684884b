"""The image frame of an array of any shape, and the half space that it images.

A line images the plane that it shares with its boresight, a plane the space before it. Positions
around the scene (a circle, an arc, a cylinder) have no front: they image what they stand around.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame, array_frame
from estimator.array.planar_array import MOST_SLANT, is_flat, planar_frame, spans_a_plane

HOLLOW = 0.2
"""Distance of the nearest position from the middle of all, over half their extent, from which they
stand around something: a full scan has positions in its middle. [-]"""


@dataclass(frozen=True, kw_only=True)
class Viewpoint:
    """A frame for images, and which part of it the array sees."""

    frame: ArrayFrame
    ahead: bool  # only what lies at y > 0 of the frame
    flat: bool  # only what lies at z = 0 of the frame: across it nothing is resolved
    note: str | None = None  # what was assumed


def viewpoint(
    positions: Float[np.ndarray, "positions 3"], boresight: Float[np.ndarray, " 3"]
) -> Viewpoint:
    """Find where an array looks.

    Parameters
    ----------
    positions
        Phase centres; where transmitters stand apart, the middles between both ends. [m]
    boresight
        Unit vector that the measurement states.

    Raises
    ------
    MeasurementError
        If there is one position only, or the boresight suits neither the line nor the plane.
    """
    if not spans_a_plane(positions):
        return Viewpoint(frame=array_frame(positions, boresight), ahead=True, flat=True)
    centred = positions - positions.mean(axis=0)
    normal = np.linalg.svd(centred, full_matrices=False)[2][2]
    middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    if not is_flat(positions):
        frame = ArrayFrame(origin=middle, axes=np.eye(3))
        return Viewpoint(frame=frame, ahead=False, flat=False)
    if abs(float(normal @ boresight)) > MOST_SLANT:
        frame = planar_frame(positions, boresight)
        return Viewpoint(frame=frame, ahead=True, flat=False)
    if stands_around(positions):
        up = normal * np.sign(normal @ [0.0, 0.0, 1.0] or 1.0)
        axes = np.stack([np.cross(boresight, up), boresight, up])
        return Viewpoint(
            frame=ArrayFrame(origin=middle, axes=axes),
            ahead=False,
            flat=True,
            note="the positions stand around the scene: its image lies in their plane, and heights "
            "above it are not resolved",
        )
    frame = planar_frame(positions, normal_of_scan(positions))
    name = "xyz"[int(np.argmax(np.abs(frame.axes[1])))]
    return Viewpoint(
        frame=frame,
        ahead=True,
        flat=False,
        note=f"the boresight {boresight.tolist()} lies in the plane of the scan; the array is "
        f"taken to look along +{name}, at a right angle to it",
    )


def normal_of_scan(positions: Float[np.ndarray, "positions 3"]) -> Float[np.ndarray, " 3"]:
    """Return the normal of a planar scan, towards the positive side of the world's axes."""
    normal = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2][2]
    return np.asarray(normal * np.sign(normal[np.argmax(np.abs(normal))]))


def stands_around(positions: Float[np.ndarray, "positions 3"]) -> bool:
    """Tell whether positions surround an empty middle, as a circle or an arc does."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    nearest = float(np.linalg.norm(positions - 0.5 * (low + high), axis=1).min())
    return nearest > HOLLOW * 0.5 * float((high - low).max())
