"""Time of arrival over several bands, stitched, at the few antennas of one access point.

Represents Chronos (Vasisht, Kumar, Katabi, NSDI 2016): separate channels together give the
resolution of their whole span, and the distances to antennas of one access point give the
position. Infrastructure: one access point, but of three antennas 0.10 m apart in a triangle (ours
is a line of 0.13 m), on the user's clock. Eight channels of 2 GHz are spaced unevenly over our
band, so that their grating lobes do not coincide; the profile is inverted as a sum of few paths,
one after the other, since the sidelobes of such a comb would hide the first path. It assumes that
the first path is the direct one.
"""

import numpy as np
from jaxtyping import Bool, Float

from validation.baselines.arrivals import first_sparse_arrival
from validation.baselines.multilateration import multilaterate
from validation.baselines.room import Anchor, Fix, Room

ANTENNAS = (Anchor(x=-0.05, y=0.0), Anchor(x=0.05, y=0.0), Anchor(x=0.0, y=-0.0866))
"""An equilateral triangle of 0.10 m, about as large as our array is long. [m]"""
CHANNELS = (0.0, 0.04, 0.13, 0.27, 0.42, 0.60, 0.83, 0.97)
"""Starts of the channels, relative to the band: uneven, so that grating lobes do not coincide.
[-]"""
WIDTH = 2e9
"""Width of a channel: about that of IEEE 802.11ad, 2.16 GHz. [Hz]"""


def multiband_toa(room: Room) -> Fix:
    """Measure the first path's length at each antenna over all channels, and intersect."""
    lengths = []
    for antenna in ANTENNAS:
        pilot = room.pilot(antenna)
        chosen = in_channels(pilot.frequencies)
        length = first_sparse_arrival(pilot.samples[0, chosen], pilot.frequencies[chosen])
        if length is None:
            return Fix(position=None, reason="an antenna hears nothing of the user")
        lengths.append(length)
    places = np.stack([antenna.position for antenna in ANTENNAS])
    return Fix(position=multilaterate(places, np.array(lengths)))


def in_channels(frequencies: Float[np.ndarray, " freqs"]) -> Bool[np.ndarray, " freqs"]:
    """Return which frequencies are in a channel."""
    starts = frequencies[0] + np.array(CHANNELS) * np.ptp(frequencies)
    beyond = frequencies[:, None] - starts
    return np.asarray(np.any((beyond >= 0) & (beyond <= WIDTH), axis=1))
