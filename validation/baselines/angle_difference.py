"""Differences of angles of arrival (ADoA) of several access points, heard by the user.

Stands for map-less mmWave positioning by angle differences (Palacios, Casari, Widmer, "JADE",
INFOCOM 2017). Beyond ours it needs three more access points (at
:data:`validation.baselines.room.ANCHORS`) and an array of 64 elements at the user, whose
orientation is unknown: so that only differences of angles count. It needs no clock and no ranging.
It assumes that the strongest path of each access point is the direct one, and that all stand on
the side that the user's array faces.
"""

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from validation.baselines.arrivals import plane_wave_angle
from validation.baselines.multilateration import CONVERGED, REACH, STARTS
from validation.baselines.room import ANCHORS, Fix, Room

ELEMENTS = 64
"""Antennas of the user's array: a beam of 1.6°, half a wavelength apart. Chosen, as the method
names none for our band. [-]"""
POINTS = 51
"""Frequencies that the angles are averaged over: of our band. [-]"""
TURN = np.radians(7.0)
"""By which the user's array is turned, unknown to the method. [rad]"""
ASIDE = 1e-3
"""By which starts stand aside of the grid: no descent begins on an anchor, where angles jump.
[m]"""


def angle_difference(room: Room) -> Fix:
    """Measure all angles at the user, and fit its position and orientation."""
    radio = room.radio.model_copy(update={"points": POINTS})
    angles = [
        plane_wave_angle(room.pilot_at_user(anchor, elements=ELEMENTS, turn=TURN, radio=radio))
        for anchor in ANCHORS
    ]
    places = np.stack([anchor.position for anchor in ANCHORS])
    return Fix(position=from_differences(places, np.array(angles)))


def from_differences(
    anchors: Float[np.ndarray, "anchors 2"], angles: Float[np.ndarray, " anchors"]
) -> Float[np.ndarray, " 2"]:
    """Find the place from which anchors appear at angles from an unknown axis.

    Parameters
    ----------
    anchors
        [m]
    angles
        From the axis, positive counter-clockwise, all on one side of it. [rad]
    """
    centre = anchors.mean(axis=0)

    def residuals(place: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " anchors"]:
        towards = anchors - place
        phasors = np.exp(1j * (np.arctan2(towards[:, 1], towards[:, 0]) - angles))
        # The orientation that fits best is the mean; what is left are differences.
        return np.asarray(np.angle(phasors / phasors.mean()))

    side = np.linspace(-REACH, REACH, STARTS)
    fits = [
        least_squares(residuals, centre + np.array([x, y]), xtol=CONVERGED, ftol=CONVERGED)
        for x in side + ASIDE
        for y in side + ASIDE
    ]
    return np.asarray(min(fits, key=lambda fit: float(fit.cost)).x)
