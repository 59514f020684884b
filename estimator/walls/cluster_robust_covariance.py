r"""The cluster-robust covariance of a fitted line, with the bias correction for few clusters.

At the least-squares minimum the scores :math:`p_i` of all places (derivatives of half the sum of
squares by the parameters) add up to 0. With the normal matrix K, and places grouped into parts b
that are independent of each other, the estimate has the covariance
:math:`K^{-1} (\sum_b p_b p_b^T) K^{-1}` (the "sandwich"). A part that holds much of K pulls the
line to itself, so that its own score is small: on a wall that shows a few glints only, the sandwich
is far too small. Each part's score is therefore divided by :math:`(1 - K_b K^{-1})^{1/2}`, which
makes the covariance unbiased where the errors of all parts have the same variance (the "CR2"
estimator of [1]_).

References
----------
.. [1] R. M. Bell, D. F. McCaffrey, "Bias reduction in standard errors for linear regression with
       multi-stage samples", Survey Methodology 28 (2), 169-181 (2002)
"""

import numpy as np
from jaxtyping import Float, Int

FEWEST_PARTS = 4
"""Parts that a line is cut into, however short it is: two of them fit any tilt and offset.
[-]"""
LEAST_LEFT = 1e-3
"""Least share of the normal matrix that is taken to lie outside a part: where one glint holds all
of it, the covariance is large (a thousand times the sandwich's), not infinite. [-]"""
TIE = 1e-6
"""Distance before the border of a part at which a place still belongs after it: evenly spaced
places lie on borders up to rounding, which must not decide. [parts]"""


def cluster_robust_covariance(
    places: Float[np.ndarray, " places"],
    designs: Float[np.ndarray, "places parameters"],
    scores: Float[np.ndarray, " places"],
    gains: Float[np.ndarray, "places parameters"],
    *,
    part: float,
) -> Float[np.ndarray, "parameters parameters"]:
    """Return the covariance of a line's parameters from the scores of its places.

    Parameters
    ----------
    places
        Along the line, ascending. [m]
    designs
        Displacement of each place by each parameter.
    scores
        Derivative of half the sum of squares by each place's displacement, at the minimum, with
        the sign of a gain.
    gains
        Decrease of each place's score with each parameter: the normal matrix is
        ``designs.T @ gains``.
    part
        Length over which the errors of places are correlated. [m]

    Returns
    -------
    The mean over two divisions of the line into parts, the second shifted by half a part.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the normal matrix is singular.
    """
    return sandwich(
        places,
        scores[:, None] * designs,
        designs[:, :, None] * gains[:, None, :],
        normal=designs.T @ gains,
        part=part,
    )


def sandwich(
    places: Float[np.ndarray, " places"],
    scores: Float[np.ndarray, "places parameters"],
    gains: Float[np.ndarray, "places parameters parameters"],
    *,
    normal: Float[np.ndarray, "parameters parameters"],
    part: float,
) -> Float[np.ndarray, "parameters parameters"]:
    """Return the covariance of parameters from each place's share of their scores.

    Parameters
    ----------
    places, part
        As for :func:`cluster_robust_covariance`.
    scores
        Each place's share of the derivatives by the parameters.
    gains
        Each place's share of the normal matrix.
    normal
        The normal matrix: their sum.
    """
    values, vectors = np.linalg.eigh(np.linalg.inv(0.5 * (normal + normal.T)))
    root = (vectors * np.sqrt(values)) @ vectors.T
    count = max(FEWEST_PARTS, int((places[-1] - places[0]) / part + TIE))
    position = count * (places - places[0]) / (places[-1] - places[0])
    covariance = np.zeros_like(root)
    for shift in (0.0, 0.5):
        first = _first_of_parts(np.minimum(position + shift, count + shift - 2 * TIE))
        pushed = np.add.reduceat(scores, first)
        held = np.add.reduceat(gains, first)
        shares, axes = np.linalg.eigh(root @ (0.5 * (held + held.swapaxes(1, 2))) @ root)
        left = np.maximum(1 - shares, LEAST_LEFT)
        steps = np.einsum("bij,bj,bkj,bk->bi", axes, left**-0.5, axes, pushed @ root)
        covariance += 0.5 * steps.T @ steps
    return np.asarray(root @ covariance @ root)


def _first_of_parts(position: Float[np.ndarray, " places"]) -> Int[np.ndarray, " parts"]:
    """Return the index of each part's first place; a part without places is none."""
    return np.flatnonzero(np.diff(np.floor(position + TIE), prepend=-1.0))
