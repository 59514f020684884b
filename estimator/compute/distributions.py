"""Quantiles and tails of distributions, by the special functions that scipy has them of.

The import of ``scipy.stats`` takes longer than the estimate of a small room.
"""

import numpy as np
from jaxtyping import Float
from scipy.special import chdtrc, fdtri, gammaincinv, ndtri, pdtrc


def chi_square_quantile(probability: float, freedom: int) -> float:
    """Return what a χ² of some degrees of freedom stays below with a probability. [-].

    Examples
    --------
    >>> round(chi_square_quantile(0.95, 2), 3)  # −2 ln 0.05
    5.991
    """
    return float(2 * gammaincinv(freedom / 2, probability))


def chi_square_tail(value: float, freedom: int) -> float:
    """Return the probability that a χ² of some degrees of freedom is larger. [-]."""
    return float(chdtrc(freedom, value))


def f_quantile(probability: float, upper: int, lower: int) -> float:
    """Return what a ratio of two mean squares stays below with a probability. [-].

    Parameters
    ----------
    probability
        Of being smaller. [-]
    upper, lower
        Degrees of freedom of the numerator and of the denominator. [-]
    """
    return float(fdtri(upper, lower, probability))


def poisson_tail(count: float, mean: float) -> float:
    """Return the probability of more events than a count, of so many expected. [-]."""
    return 1.0 if count < 0 else float(pdtrc(np.floor(count), mean))


def normal_density(
    value: Float[np.ndarray, "*n"] | float, mean: float, deviation: float
) -> Float[np.ndarray, "*n"]:
    """Return the density of a normal distribution, over the unit of its deviation."""
    standard = (np.asarray(value) - mean) / deviation
    return np.asarray(np.exp(-(standard**2) / 2) / np.sqrt(2 * np.pi) / deviation)


def normal_limit(probability: float) -> float:
    """Return what a standard normal variable exceeds with a probability. [-]."""
    return float(-ndtri(probability))
