"""Differences of the time of arrival at several receivers.

Represents hyperbolic positioning (after Chan and Ho, IEEE Trans. Signal Process. 1994): the
receivers share a clock, the user needs none. Beyond ours it needs three more receivers (at
:data:`validation.baselines.room.ANCHORS`), synchronised to picoseconds. It assumes that the first
path is the direct one. As the receivers are close together, hyperbolas intersect at small angles:
the error of range is much larger than that of direction.
"""

from validation.baselines.room import Fix, Room
from validation.baselines.toa_trilateration import toa_trilateration


def tdoa(room: Room) -> Fix:
    """Measure the first path at each receiver, and use the differences alone."""
    return toa_trilateration(room, clock_known=False)
