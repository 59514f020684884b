r"""Corrected trapezoidal rule for functions with a logarithmic singularity on a grid point.

On a uniform grid of step :math:`h`, for a smooth function :math:`F`,

.. math:: \int F(x) \ln|x|\,dx = h \sum_{j \ne 0} F(jh) \ln|jh| + h F(0) \ln h
          + h \sum_{|j| \le m} c_{|j|} F(jh)

For a wave :math:`F = e^{j \omega x / h}` the error of the punctured sum over *all* points is, by
Poisson's formula,

.. math:: T(\omega) = -\ln 2\pi - \gamma
          - \tfrac12 \bigl[\psi(1 - \tfrac{\omega}{2\pi}) + \psi(1 + \tfrac{\omega}{2\pi})\bigr]

with the digamma function :math:`\psi`; its series at 0 is that of the zeta-corrected rule
[1]_, whose :math:`c_j` are determined by derivatives at :math:`\omega = 0`. Here the cosine
polynomial :math:`\sum c_{|j|} \cos j\omega` is fitted to :math:`T` over the band of the functions,
so that a grid of some six points per wavelength is spectrally accurate. Unlike that of Kress [2]_,
the correction is local, so distant points interact by the plain kernel and can be compressed.

References
----------
.. [1] B. Wu, P.-G. Martinsson, "Zeta correction: a new approach to constructing corrected
   trapezoidal quadrature rules for singular integral operators", Adv. Comput. Math. 47, 2021.
.. [2] R. Kress, "Boundary integral equations in time-harmonic acoustic scattering", Math.
   Comput. Modelling 15, 1991.
"""

import functools

import numpy as np
from jaxtyping import Float
from scipy.special import digamma

BAND = 2.4
"""Largest phase from one point to the next of the integrand, kernel times density: twice that of a
wave at 5.2 points per wavelength. [rad]"""

REACH = 14
"""Neighbours on each side that are corrected: the error of the fit is 8e-8. [-]"""

_SAMPLES = 400


def missing_logarithm(phase: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    r"""Return :math:`T(\omega)`, the error of the punctured trapezoidal rule. [-].

    Parameters
    ----------
    phase
        :math:`\omega`, phase from one point to the next, below :math:`2\pi`. [rad]
    """
    turns = phase / (2 * np.pi)
    both = digamma(1 - turns) + digamma(1 + turns)
    return np.asarray(-np.log(2 * np.pi) - np.euler_gamma - 0.5 * both)


@functools.cache
def _weights(reach: int, band: float) -> tuple[float, ...]:
    # Chebyshev points in cos ω make least squares nearly minimax.
    spread = np.cos(np.pi * (np.arange(_SAMPLES) + 0.5) / _SAMPLES)
    low = np.cos(band)
    phase = np.arccos(0.5 * (1 + low) + 0.5 * (1 - low) * spread)
    waves = np.cos(phase[:, None] * np.arange(reach + 1))
    waves[:, 1:] *= 2
    weights = np.linalg.lstsq(waves, missing_logarithm(phase), rcond=None)[0]
    return tuple(weights.tolist())


def log_weights(*, reach: int = REACH, band: float = BAND) -> Float[np.ndarray, " weights"]:
    r"""Return :math:`c_0 \dots c_m`, the corrections of a point and of its neighbours. [-].

    Parameters
    ----------
    reach
        :math:`m`, neighbours on each side.
    band
        Largest phase from one point to the next for which the weights are fitted. [rad]

    Raises
    ------
    ValueError
        If the band is not between 0 and π, or no neighbour is corrected.
    """
    if not (0 < band < np.pi and reach >= 1):
        raise ValueError(
            f"band = {band:g} rad must lie between 0 and π, and reach = {reach} be at least 1: "
            "beyond π the grid does not tell one wave from another; take a finer grid"
        )
    return np.array(_weights(reach, band))
