"""The close-up of a user's angle/range map: finely sampled around the answer."""

import numpy as np
from scipy.constants import speed_of_light

from estimator.channel.angle_range_map_2d import angle_range_map
from estimator.measurement.model import Uplink
from estimator.results.estimate import AngleRangeMap, UserEstimate

CLOSE_UP = 80
"""Samples of the close-up to either side."""
CLOSE_UP_SAMPLES = 8
"""Samples of the close-up for each resolution cell λ/D or c/B."""


def close_up(uplink: Uplink, looked: AngleRangeMap, found: UserEstimate) -> AngleRangeMap:
    """Map the surroundings of the answer, or of the map's peak without one, finely.

    Parameters
    ----------
    uplink
        In the frame of a linear array.
    looked
        Its map over everything that is looked at.
    found
        The answer.
    """
    if found.aoa is not None and found.path_length is not None:
        aoa, length = found.aoa, found.path_length
    else:
        peak = np.unravel_index(int(np.argmax(np.abs(looked.values))), looked.values.shape)
        aoa, length = float(looked.aoa[peak[0]]), float(looked.path_length[peak[1]])
    steps = np.arange(-CLOSE_UP, CLOSE_UP + 1) / CLOSE_UP_SAMPLES
    beam = speed_of_light / float(uplink.frequencies.mean()) / float(np.ptp(uplink.positions[:, 0]))
    cosines = np.cos(aoa) - beam * steps
    lengths = length + speed_of_light / float(np.ptp(uplink.frequencies)) * steps
    lengths = lengths[(lengths > looked.path_length[0]) & (lengths < looked.path_length[-1])]
    return angle_range_map(
        uplink,
        aoa=np.arccos(cosines[np.abs(cosines) < 1]),
        path_length=lengths,
        centre=np.zeros(3),
    )
