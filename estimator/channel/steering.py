r"""Steering vectors of any element layout, and angle spectra at one frequency.

A vector is what a source of unit amplitude at the array's centre makes the elements
receive, so that a matched filter multiplies with its conjugate. With exp(+jωt) a source at
distance r arrives as exp(-jkr): (3-4) to (3-10) of the thesis use the other sign, and (3-8)
needs a minus before 2dR cos θ; correcting one of both alone would put 70° at 110°.
"""

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.channel.angle_range_map_2d import X_AXIS, Y_AXIS, polar_points
from estimator.measurement.model import MeasurementError, Uplink


def spherical_steering(
    points: Float[np.ndarray, "*grid 3"],
    positions: Float[np.ndarray, "elements 3"],
    frequency: float,
    *,
    centre: Float[np.ndarray, " 3"] | None = None,
) -> Complex[np.ndarray, "*grid elements"]:
    r"""Evaluate (3-10): :math:`(R / r_m) e^{-j k (r_m - R)}` for sources at points.

    Parameters
    ----------
    points
        Sources. [m]
    positions
        Elements, of any layout and number. [m]
    frequency
        [Hz]
    centre
        Where R is measured from; ``None``: the mean of the elements. [m]

    Raises
    ------
    MeasurementError
        If a source lies on an element.
    """
    origin = positions.mean(axis=0) if centre is None else centre
    offsets = positions - origin
    rays = points - origin
    distance = np.linalg.norm(rays, axis=-1)[..., None]
    length = np.linalg.norm(rays[..., None, :] - offsets, axis=-1)
    if not np.all(length > 0):
        raise MeasurementError("a source lies on an element; its field is infinite there")
    # r - R without cancellation.
    excess = ((offsets**2).sum(axis=-1) - 2 * rays @ offsets.T) / (length + distance)
    turns = excess * (frequency / speed_of_light)
    return np.asarray(distance / length * np.exp(-2j * np.pi * turns))


def plane_steering(
    aoa: Float[np.ndarray, " angles"],
    positions: Float[np.ndarray, "elements 3"],
    frequency: float,
    *,
    centre: Float[np.ndarray, " 3"] | None = None,
    axis: Float[np.ndarray, " 3"] = X_AXIS,
    boresight: Float[np.ndarray, " 3"] = Y_AXIS,
) -> Complex[np.ndarray, "angles elements"]:
    r"""Evaluate (3-19): :math:`e^{+j k\, q_m \cdot \hat s(\theta)}`, the limit R → ∞ of (3-10).

    Parameters
    ----------
    aoa
        Angles from the array's axis, on the side of the boresight. [rad]
    positions
        Elements. [m]
    frequency
        [Hz]
    centre
        Where the phase is 0; ``None``: the mean of the elements. [m]
    axis, boresight
        Unit vectors of the plane in which the angles lie.
    """
    origin = positions.mean(axis=0) if centre is None else centre
    towards = polar_points(
        aoa=aoa, path_length=np.ones(1), centre=np.zeros(3), axis=axis, boresight=boresight
    )[:, 0]
    turns = towards @ (positions - origin).T * (frequency / speed_of_light)
    return np.asarray(np.exp(2j * np.pi * turns))


def angle_spectrum(
    uplink: Uplink,
    aoa: Float[np.ndarray, " angles"],
    *,
    frequency: float,
    distance: float | None = None,
    axis: Float[np.ndarray, " 3"] = X_AXIS,
    boresight: Float[np.ndarray, " 3"] = Y_AXIS,
) -> Complex[np.ndarray, " angles"]:
    r"""Match an uplink at one frequency to waves from each angle.

    Parameters
    ----------
    uplink
        Pilot of one user.
    aoa
        Angles from the array's axis. [rad]
    frequency
        The sweep's point nearest to this one is used. [Hz]
    distance
        Distance of the sources, for the spherical vector (3-10); ``None``: plane waves,
        (3-19). [m]
    axis, boresight
        Unit vectors of the plane in which the angles lie.

    Returns
    -------
    :math:`a^H s / a^H a`: the least-squares amplitude at the array's centre. [-]

    Raises
    ------
    MeasurementError
        If the frequency is outside the sweep.
    """
    low, high = float(uplink.frequencies[0]), float(uplink.frequencies[-1])
    if not low <= frequency <= high:
        raise MeasurementError(
            f"frequency {frequency:.6g} Hz is outside the sweep, {low:.6g} … {high:.6g} Hz"
        )
    index = int(np.argmin(np.abs(uplink.frequencies - frequency)))
    nearest = float(uplink.frequencies[index])
    if distance is None:
        steering = plane_steering(aoa, uplink.positions, nearest, axis=axis, boresight=boresight)
    else:
        centre = uplink.positions.mean(axis=0)
        points = polar_points(
            aoa=aoa,
            path_length=np.array([distance]),
            centre=centre,
            axis=axis,
            boresight=boresight,
        )[:, 0]
        steering = spherical_steering(points, uplink.positions, nearest)
    power = (np.abs(steering) ** 2).sum(axis=-1)
    return np.asarray(steering.conj() @ uplink.samples[:, index] / power)
