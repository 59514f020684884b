r"""The covariance of a line from the pushes of its parts, none of which is trusted to judge itself.

Least squares along a wall end with the pushes :math:`p_i` of all places in balance. What an
estimate scatters by follows from them, :math:`K^{-1} \sum p_b p_b^T K^{-1}` over independent
parts b with the normal matrix K, but a part that holds much of K has pulled the line to where its
own push is small: over a wall that shows a few glints only, the sum is far too small. Each part's
push is therefore divided by the root of what the others hold, :math:`(1 - K_b K^{-1})^{1/2}`,
which makes the covariance unbiased where all parts push alike [1]_.

References
----------
.. [1] R. M. Bell, D. F. McCaffrey, "Bias reduction in standard errors for linear regression with
       multi-stage samples", Survey Methodology 28 (2), 169-181 (2002)
"""

import numpy as np
from jaxtyping import Float, Int

FEWEST_PARTS = 4
"""Parts that a line is cut into, however short it is: two of them fit any tilt and offset."""
LEAST_LEFT = 1e-3
"""Least share of the normal matrix that is taken to lie outside a part: a line that stands on
one glint is not known, and its variance is large, not infinite. [-]"""
TIE = 1e-6
"""By how much a place may lie before a cut and still belong after it: evenly spaced places lie on
cuts but for rounding, which must not decide. [parts]"""


def clustered_covariance(
    places: Float[np.ndarray, " places"],
    designs: Float[np.ndarray, "places parameters"],
    scores: Float[np.ndarray, " places"],
    gains: Float[np.ndarray, "places parameters"],
    *,
    part: float,
) -> Float[np.ndarray, "parameters parameters"]:
    """Return the covariance of parameters from what pushes them, place by place.

    Parameters
    ----------
    places
        Along the line, ascending. [m]
    designs
        By how much each place moves with each parameter.
    pushes
        Of each place, at the minimum: half of what the sum of squares would gain by its move.
    gains
        How much each place's push changes with each parameter: the normal matrix is
        ``designs.T @ gains``.
    part
        Length within which places push with or against each other. [m]

    Returns
    -------
    The mean over two cuts of the line into parts, the second half a part on, so that no place
    is always at an edge.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the normal matrix is singular.
    """
    normal = designs.T @ gains
    values, vectors = np.linalg.eigh(np.linalg.inv(0.5 * (normal + normal.T)))
    root = (vectors * np.sqrt(values)) @ vectors.T
    count = max(FEWEST_PARTS, int((places[-1] - places[0]) / part + TIE))
    position = count * (places - places[0]) / (places[-1] - places[0])
    covariance = np.zeros_like(root)
    for shift in (0.0, 0.5):
        first = _first_of_parts(np.minimum(position + shift, count + shift - 2 * TIE))
        pushed = np.add.reduceat(scores[:, None] * designs, first)
        held = np.add.reduceat(designs[:, :, None] * gains[:, None, :], first)
        shares, axes = np.linalg.eigh(root @ (0.5 * (held + held.swapaxes(1, 2))) @ root)
        left = np.maximum(1 - shares, LEAST_LEFT)
        steps = np.einsum("bij,bj,bkj,bk->bi", axes, left**-0.5, axes, pushed @ root)
        covariance += 0.5 * steps.T @ steps
    return np.asarray(root @ covariance @ root)


def _first_of_parts(position: Float[np.ndarray, " places"]) -> Int[np.ndarray, " parts"]:
    """Return the index of each part's first place; a part without places is none."""
    return np.flatnonzero(np.diff(np.floor(position + TIE), prepend=-1.0))
