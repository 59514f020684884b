"""Points whose paths to all antennas are shorter than the unambiguous one."""

import numpy as np
from jaxtyping import Float

from estimator.imaging.range_compression import RangeProfiles
from estimator.measurement.model import MeasurementError


def refuse_points_out_of_range(
    profiles: RangeProfiles, points: Float[np.ndarray, "3 points"]
) -> None:
    """Refuse points that cannot be focused.

    Raises
    ------
    MeasurementError
        If a point lies beyond the unambiguous range or is not finite.
    """
    low, high = points.min(axis=1), points.max(axis=1)  # NaN if any is
    if not np.all(np.isfinite([low, high])):
        bad = int(np.count_nonzero(~np.isfinite(points).all(axis=0)))
        raise MeasurementError(
            f"{bad} of {points.shape[1]} pixels have NaN or infinite coordinates"
        )
    # The triangle inequality over the arrays' centres is quick, and mostly enough.
    if _longest_about(profiles, points) <= profiles.unambiguous:
        return
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1)
    # A length is convex, over the points' places and over the antennas': at most what corners of
    # the boxes around them give.
    if np.all(_longest_possible(profiles, corners) <= profiles.unambiguous):
        return
    bound = _longest_possible(profiles, points)
    longest = _longest_path(profiles, points[:, bound > profiles.unambiguous])
    if longest > profiles.unambiguous:
        ways = profiles.passes * len(profiles.legs)
        raise MeasurementError(
            f"pixels reach {longest / ways:.3f} m from the array, but the frequency step is "
            f"unambiguous only up to {profiles.unambiguous / ways:.3f} m; take smaller frequency "
            "steps or a nearer grid"
        )


def _longest_about(profiles: RangeProfiles, points: Float[np.ndarray, "3 points"]) -> float:
    """Bound all paths by those to the antennas' centres. [m]."""
    ways = 0.0
    for leg in profiles.legs:
        centre = leg.mean(axis=0)
        square = sum((row - middle) ** 2 for row, middle in zip(points, centre, strict=True))
        ways += float(np.sqrt(np.max(square)) + np.linalg.norm(leg - centre, axis=-1).max())
    return profiles.passes * ways


def _longest_possible(
    profiles: RangeProfiles, points: Float[np.ndarray, "3 points"]
) -> Float[np.ndarray, " points"]:
    """Bound the paths from points to the antennas. [m]."""
    ways = np.sum([_farthest_corner(leg, points) for leg in profiles.legs], axis=0)
    return np.asarray(profiles.passes * ways)


def _farthest_corner(
    leg: Float[np.ndarray, "channels 3"], points: Float[np.ndarray, "3 points"]
) -> Float[np.ndarray, " points"]:
    """Distance of each point to the farthest corner of the box around a leg's antennas. [m]."""
    low, high = leg.min(axis=0)[:, None], leg.max(axis=0)[:, None]
    far = np.maximum(np.abs(points - low), np.abs(points - high))
    distance: np.ndarray = np.sqrt(np.einsum("xp,xp->p", far, far))
    return distance


def _longest_path(profiles: RangeProfiles, points: Float[np.ndarray, "3 points"]) -> float:
    longest = 0.0
    for channel in zip(*profiles.legs, strict=True) if points.size else ():
        path = sum(np.linalg.norm(points - end[:, None], axis=0) for end in channel)
        longest = max(longest, profiles.passes * float(np.max(path)))
    return longest
