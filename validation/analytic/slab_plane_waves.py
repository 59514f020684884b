r"""A slab between a line source and a receiver, exactly: the integral over all plane waves.

.. math:: \frac{E}{E_0} = \frac{\int T(\alpha) e^{jkd\cos\alpha} e^{-jkL\cos(\alpha - \theta)}
                                d\alpha}{\int e^{-jkL\cos(\alpha - \theta)} d\alpha}

along the path of steepest descent of the free wave. The slab's :math:`T` is computed by the
characteristic matrix of a layer (Born and Wolf, 1.6.2), independent of the simulator's sum of
internal reflections.
"""

import numpy as np
from scipy.constants import speed_of_light

STEPS = 20001
"""Points along the path of steepest descent. [-]"""

REACH = 1.2
"""Extent of the path to either side: the integrand is smaller by exp(-kL·0.8) there. [rad]"""


def slab_over_air(
    permittivity: complex,
    thickness: float,
    *,
    angle: float,
    length: float,
    frequency: float,
    vertical: bool,
) -> complex:
    """Return the field of a line source behind a slab over that without it. [-].

    Parameters
    ----------
    permittivity, thickness
        Of the slab. [-], [m]
    angle
        Between its normal and the line from source to receiver. [rad]
    length
        Of that line. [m]
    frequency
        [Hz]
    vertical
        Whether the electric field is along the line source, else the magnetic one.
    """
    wavenumber = 2 * np.pi * frequency / speed_of_light
    steps = np.linspace(-REACH, REACH, STEPS)
    path = angle + np.arctan(np.sinh(steps)) + 1j * steps
    wave = np.exp(-1j * wavenumber * length * np.cos(path - angle)) * (1 / np.cosh(steps) + 1j)
    cosine, inner = np.cos(path), np.sqrt(permittivity - np.sin(path) ** 2)
    once = wavenumber * thickness * inner
    ratio = inner / cosine if vertical else inner / (permittivity * cosine)
    through = 1 / (np.cos(once) + 0.5j * (ratio + 1 / ratio) * np.sin(once))
    through = through * np.exp(1j * wavenumber * thickness * cosine)
    return complex(np.sum(wave * through) / np.sum(wave))
