"""Time of arrival at several anchors, and multilateration.

Represents ultra-wideband ranging (IEEE 802.15.4a, 4z) on our band. Beyond ours it needs three
more anchors (of one antenna each, at :data:`validation.baselines.room.ANCHORS`), all on the
user's clock. It assumes that the first path is the direct one.
"""

import numpy as np

from validation.baselines.arrivals import first_arrival
from validation.baselines.multilateration import multilaterate
from validation.baselines.room import ANCHORS, Fix, Room

FEWEST = 3
"""Least number of anchors that receive the user, plus one if its clock is unknown: two circles
intersect at two points. [-]"""


def toa_trilateration(room: Room, *, clock_known: bool = True) -> Fix:
    """Measure the first path's length at each anchor, and intersect."""
    places, lengths = [], []
    for anchor in ANCHORS:
        pilot = room.pilot(anchor)
        length = first_arrival(pilot.samples[0], pilot.frequencies)
        if length is not None:
            places.append(anchor.position)
            lengths.append(length)
    least = FEWEST if clock_known else FEWEST + 1
    if len(places) < least:
        return Fix(position=None, reason=f"{len(places)} anchors hear the user; {least} are needed")
    found = multilaterate(np.stack(places), np.array(lengths), clock_known=clock_known)
    return Fix(position=found)
