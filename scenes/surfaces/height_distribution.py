r"""Heights that are not Gaussian: a monotonic transform of a Gaussian surface.

With the standard Gaussian height g, uniform heights are :math:`\sqrt{12}\,(\Phi(g) - \tfrac12)`
and lognormal ones :math:`(e^{bg} - e^{b^2/2}) / \sqrt{e^{b^2}(e^{b^2} - 1)}`, whose skewness is
:math:`(e^{b^2} + 2)\sqrt{e^{b^2} - 1}`; a negative one turns the surface upside down. The rms
height stays; the correlation falls to 1/e some 2 % earlier (of a Gaussian spectrum; uniform, or
lognormal with a skewness of 1).
"""

import math

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr

from scenes.schema.roughness import Distribution


def transformed(
    heights: Float[np.ndarray, "*n"], *, rms: float, distribution: Distribution, skewness: float
) -> Float[np.ndarray, "*n"]:
    """Give Gaussian heights another distribution of the same rms height.

    Parameters
    ----------
    heights
        Gaussian. [m]
    rms
        Their root mean square, in the expectation. [m]
    distribution
        Which one.
    skewness
        Of a lognormal distribution, not zero. [-]
    """
    if distribution == "gaussian" or rms == 0:
        return heights
    standard = heights / rms
    if distribution == "uniform":
        return np.asarray(rms * math.sqrt(12.0) * (ndtr(standard) - 0.5))
    width = lognormal_width(abs(skewness))
    side = math.copysign(1.0, skewness)
    spread = math.exp(width**2)
    scale = 1.0 / math.sqrt(spread * (spread - 1.0))
    return np.asarray(
        side * rms * scale * (np.exp(width * side * standard) - math.exp(0.5 * width**2))
    )


def lognormal_width(skewness: float) -> float:
    r"""Return b for a skewness s: :math:`x = e^{b^2}` solves :math:`x^3 + 3 x^2 = 4 + s^2`. [-]."""
    # With y = x + 1: y³ - 3y = 2 + s²; its one real root is 2 cosh(arcosh(1 + s²/2) / 3).
    root = 2.0 * math.cosh(math.acosh(1.0 + 0.5 * skewness**2) / 3.0)
    return math.sqrt(math.log(root - 1.0))
