"""The field regions of an aperture, after (3-1) to (3-3) of the thesis."""

from typing import Literal

import numpy as np

from estimator.measurement.model import MeasurementError

FieldRegion = Literal["reactive near field", "radiating near field", "far field"]


def fresnel_distance(aperture_length: float, wavelength: float) -> float:
    """Return 0.62 √(D³/λ) of (3-1), in metres.

    Below it the phase of a wavefront over the aperture is no longer quadratic. For one
    radiator of size D this is also where its reactive field ends; a synthetic array has no
    such field, and the bound is only about the phase.
    """
    _check(aperture_length, wavelength)
    return float(0.62 * np.sqrt(aperture_length**3 / wavelength))


def far_field_distance(aperture_length: float, wavelength: float) -> float:
    """Return 2D²/λ of (3-3), in metres: beyond it the wavefront bends by less than λ/16.

    The thesis prints the far field as R < 2D²/λ; it is R > 2D²/λ.
    """
    _check(aperture_length, wavelength)
    return 2 * aperture_length**2 / wavelength


def field_region(distance: float, aperture_length: float, wavelength: float) -> FieldRegion:
    """Name the region (3-1), (3-2) or (3-3) in which a distance lies.

    Parameters
    ----------
    distance
        From the aperture. [m]
    aperture_length
        Its largest extent D. [m]
    wavelength
        Of the wave; the shortest of a band puts the bounds farthest out. [m]

    Raises
    ------
    MeasurementError
        If a length is not positive.
    """
    if not (np.isfinite(distance) and distance > 0):
        raise MeasurementError(f"distance is {distance:g} m; it must be positive and finite")
    if distance < fresnel_distance(aperture_length, wavelength):
        return "reactive near field"
    if distance < far_field_distance(aperture_length, wavelength):
        return "radiating near field"
    return "far field"


def curvature(distance: float, aperture_length: float, wavelength: float) -> float:
    """Return the phase πD²/(4λR) by which a spherical wavefront bends at the aperture's ends.

    In radians; a plane-wave model errs by this much, π/8 at the far-field distance.
    """
    _check(aperture_length, wavelength)
    return float(np.pi * aperture_length**2 / (4 * wavelength * distance))


def _check(aperture_length: float, wavelength: float) -> None:
    for name, value in (("aperture length", aperture_length), ("wavelength", wavelength)):
        if not (np.isfinite(value) and value > 0):
            raise MeasurementError(f"{name} is {value:g} m; it must be positive and finite")
