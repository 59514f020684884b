"""Angle and time of arrival at one array, without a map.

Represents single-anchor mmWave positioning (after Lemic et al. and the thesis' own first step):
our base station, our pilot and our path search, but no echo, and so no walls. The strongest path
is assumed to be direct; over a mirror this gives the user's image, as far behind the wall as the
user is in front of it.
"""

import numpy as np

from estimator.channel.relax import extract_paths
from validation.baselines.room import Fix, Room


def single_array(room: Room) -> Fix:
    """Locate the user by the strongest path, assumed to be direct."""
    station = room.scenario.base_station
    x, y, _ = station.centre
    pilot = room.pilot(room.own_array)
    boresight = np.array([*station.boresight[:2], 0.0])
    axis = np.array([boresight[1], -boresight[0], 0.0])
    paths = extract_paths(pilot, most=1, axis=axis, boresight=boresight)
    if not paths:
        return Fix(position=None, reason="no path stands out of the noise")
    towards = np.cos(paths[0].aoa) * axis[:2] + np.sin(paths[0].aoa) * boresight[:2]
    return Fix(position=np.array([x, y]) + paths[0].path_length * towards)
