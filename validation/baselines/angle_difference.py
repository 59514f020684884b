"""Differences of angles of arrival (ADoA) of several access points, measured by the user.

Represents map-less mmWave positioning by angle differences (Palacios, Casari, Widmer, "JADE",
INFOCOM 2017). Beyond ours it needs three more access points (at
:data:`validation.baselines.room.ANCHORS`) and an array of 64 elements at the user, whose
orientation is unknown, so that only differences of angles are used. It needs no clock and no
ranging. It assumes that the strongest path of each access point is the direct one, and that all are
on the side that the user's array faces.
"""

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from validation.baselines.arrivals import plane_wave_angle
from validation.baselines.multilateration import CONVERGED, REACH, STARTS
from validation.baselines.room import ANCHORS, Fix, Room

ELEMENTS = 64
"""Antennas of the user's array: a beam of 1.6° at a spacing of half a wavelength. Chosen: the
publication states none for our band. [-]"""
POINTS = 51
"""Frequencies in our band over which the angles are averaged. [-]"""
TURN = np.radians(7.0)
"""Rotation of the user's array, unknown to the method. [rad]"""
ASIDE = 1e-3
"""Displacement of starting points from the grid: no descent begins on an anchor, where angles are
undefined. [m]"""


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
    """Return the position at which anchors have the given angles from an unknown axis. [m].

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
        # The best orientation is the mean; the residuals are differences of angles.
        return np.asarray(np.angle(phasors / phasors.mean()))

    side = np.linspace(-REACH, REACH, STARTS)
    fits = [
        least_squares(residuals, centre + np.array([x, y]), xtol=CONVERGED, ftol=CONVERGED)
        for x in side + ASIDE
        for y in side + ASIDE
    ]
    return np.asarray(min(fits, key=lambda fit: float(fit.cost)).x)
