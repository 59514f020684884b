"""Sommerfeld's half plane: the field of a plane wave behind a thin conductor or a black screen."""

import numpy as np
from jaxtyping import Complex, Float
from scipy.special import fresnel


def fresnel_tail(x: Float[np.ndarray, "*n"]) -> Complex[np.ndarray, "*n"]:
    """Return the integral of exp(-jt²) from x to infinity, over that of the whole line. [-]."""
    sine, cosine = fresnel(np.sqrt(2 / np.pi) * x)
    return np.asarray((1 + 1j) / 2 * ((0.5 - cosine) - 1j * (0.5 - sine)))


def half_plane_over_free_space(
    incident: float,
    outgoing: Float[np.ndarray, " places"],
    phase: Float[np.ndarray, "places freqs"],
    *,
    reflection: float,
) -> Complex[np.ndarray, "places freqs"]:
    """Return the total field over that of the plane wave alone (Born and Wolf, 11.5). [-].

    Parameters
    ----------
    incident, outgoing
        Angles from the half plane to the direction of incidence, and to the places. [rad]
    phase
        Wavenumber times the distance from the edge. [rad]
    reflection
        -1: the electric field is along the edge; 1: the magnetic field; 0: a black screen. [-]
    """
    total = np.zeros(phase.shape, dtype=np.complex128)
    for angles, weight in ((outgoing - incident, 1.0), (outgoing + incident, reflection)):
        root = np.sqrt(2 * phase)
        total += (
            weight
            * fresnel_tail(-root * np.cos(angles / 2)[:, None])
            * np.exp(1j * phase * np.cos(angles)[:, None])
        )
    return np.asarray(total * np.exp(-1j * phase * np.cos(outgoing - incident)[:, None]))
