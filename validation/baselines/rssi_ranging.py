"""Ranging by signal strength: a path-loss model, calibrated, and multilateration.

Represents the family of RADAR's propagation model and its successors (Bahl and Padmanabhan,
INFOCOM 2000). Beyond ours it needs three more anchors (of one antenna each, at
:data:`validation.baselines.room.ANCHORS`), and a survey: pilots of the same transmitter at
known places, from which the level at 1 m and the exponent of the path loss are fitted. It assumes
that strength determines distance: the same antenna gain everywhere, no shadowing, no second path.
"""

import numpy as np
from jaxtyping import Float

from validation.baselines.arrivals import strength_db
from validation.baselines.multilateration import multilaterate
from validation.baselines.room import ANCHORS, Fix, Room

SURVEY = np.array([[0.15, 0.25], [0.3, 0.35], [0.4, 0.5], [0.55, 0.6], [0.6, 0.8], [0.8, 0.7]])
"""Known positions of the calibration. [m]"""


def rssi_ranging(room: Room) -> Fix:
    """Calibrate the path loss, range by it, and multilaterate."""
    distances, levels = [], []
    for place in SURVEY:
        for anchor in ANCHORS:
            distances.append(float(np.linalg.norm(place - anchor.position)))
            levels.append(strength_db(room.pilot(anchor, survey=place)))
    slope, level = path_loss(np.array(distances), np.array(levels))
    if not slope < 0:
        return Fix(position=None, reason="strength does not fall with distance in the survey")
    heard = np.array([strength_db(room.pilot(anchor)) for anchor in ANCHORS])
    ranges = 10 ** ((heard - level) / slope)
    places = np.stack([anchor.position for anchor in ANCHORS])
    return Fix(position=multilaterate(places, ranges, relative=True))


def path_loss(
    distances: Float[np.ndarray, " n"], levels_db: Float[np.ndarray, " n"]
) -> tuple[float, float]:
    """Fit the level over the logarithm of distance: slope [dB per decade], level at 1 m [dB]."""
    slope, level = np.polyfit(np.log10(distances), levels_db, 1)
    return float(slope), float(level)
