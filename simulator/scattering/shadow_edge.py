r"""Diffraction by a straight edge, uniform across the shadow boundary (UTD).

A conducting wedge with the exterior angle :math:`n\pi`, illuminated from the angle
:math:`\varphi'`, diffracts towards :math:`\varphi`, in two dimensions over distances s' and s [1]_,

.. math:: E = E_i \, D \, \frac{e^{-jks}}{\sqrt s}, \qquad
          D = -\frac{e^{-j\pi/4}}{2n\sqrt{2\pi k}} \sum_{\pm} \left[
          \frac{F(kLa^\pm(\beta^-))}{\tan((\pi \pm \beta^-)/2n)} -
          \frac{F(kLa^\pm(\beta^+))}{\tan((\pi \pm \beta^+)/2n)} \right]

with :math:`\beta^\pm = \varphi \pm \varphi'`, :math:`L = s s'/(s + s')`,
:math:`a^\pm(\beta) = 2\cos^2(\pi n N^\pm - \beta/2)` and Fresnel's transition function
:math:`F(x) = 2j\sqrt x\, e^{jx} \int_{\sqrt x}^\infty e^{-j\tau^2} d\tau`; the second term is
added, not subtracted, for the magnetic field along the edge. On the shadow boundary it is half of
the incident field, so that the sum with the direct wave is continuous. An absorber does not
reflect, and has no second term: Kirchhoff's black screen; an opaque dielectric is treated as one
(heuristic).

References
----------
.. [1] R. G. Kouyoumjian and P. H. Pathak, "A uniform geometrical theory of diffraction for an edge
   in a perfectly conducting surface", Proc. IEEE 62 (1974) 1448, doi:10.1109/PROC.1974.9651.
"""

import numpy as np
from jaxtyping import Complex, Float
from scipy.special import wofz

BOUNDARY = 1e-7
"""Least distance from a boundary at which the coefficient is evaluated: a cotangent has its pole
there. [rad]"""


def transition(x: Float[np.ndarray, "*n"]) -> Complex[np.ndarray, "*n"]:
    """Return Fresnel's transition function, 0 at 0 and 1 far off. [-]."""
    root = np.sqrt(x)
    turned = np.exp(0.25j * np.pi)
    return np.asarray(np.sqrt(np.pi) * root * turned * wofz(1j * turned * root))


def wedge_coefficient(
    incident: float,
    outgoing: Float[np.ndarray, " places"],
    before: float | Float[np.ndarray, " places"],
    beyond: Float[np.ndarray, " places"],
    wavenumbers: Float[np.ndarray, " freqs"],
    *,
    exterior: float,
    reflection: float,
) -> Complex[np.ndarray, "places freqs"]:
    """Coefficient of diffraction D. [m^½].

    Parameters
    ----------
    incident, outgoing
        Angles to both ends from the wedge's first face, through the air. [rad]
    before, beyond
        Distances of both ends from the edge; in space times the squared sine of the angle between
        ray and edge. [m]
    wavenumbers
        [1/m]
    exterior
        Exterior angle (in air) over π. [-]
    reflection
        Of the faces: -1 for the electric field along the edge, 1 for the magnetic one, 0: none.
    """
    phase = (before * beyond / (before + beyond))[:, None] * wavenumbers
    total = _pair(outgoing - incident, phase, exterior)
    if reflection:
        total = total + reflection * _pair(outgoing + incident, phase, exterior)
    scale = -np.exp(-0.25j * np.pi) / (2 * exterior * np.sqrt(2 * np.pi * wavenumbers))
    return np.asarray(scale * total)


def _pair(
    beta: Float[np.ndarray, " places"], phase: Float[np.ndarray, "places freqs"], exterior: float
) -> Complex[np.ndarray, "places freqs"]:
    total = np.zeros(phase.shape, dtype=np.complex128)
    for sign in (1.0, -1.0):
        pole = np.abs(np.sin((np.pi + sign * beta) / (2 * exterior))) < BOUNDARY / 4
        at = np.where(pole, beta + BOUNDARY, beta)
        whole = np.rint((at + sign * np.pi) / (2 * np.pi * exterior))
        off = 2 * np.pi * exterior * whole - at
        spread = transition(phase * (2 * np.cos(off / 2) ** 2)[:, None])
        total = total + spread / np.tan((np.pi + sign * at) / (2 * exterior))[:, None]
    return total
