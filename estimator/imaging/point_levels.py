"""How bright point scatterers are that an echo shows."""

import numpy as np
from jaxtyping import Float

from estimator.array.windows import survey_weights
from estimator.imaging.backprojection import backproject
from estimator.measurement.model import Echo

FAINTEST = 1e-30
"""Least magnitude, so that its logarithm stays finite. [-]"""


def point_levels_db(
    echo: Echo, points: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, " points"]:
    """Return the S-parameters of point scatterers that are as bright, with the survey's taper.

    Parameters
    ----------
    echo
        The echo.
    points
        Where it is focused, within its unambiguous range. [m]

    Returns
    -------
    20 log10 of them. [dB]
    """
    values = np.abs(backproject(echo, points, weights=survey_weights(echo)))
    return np.asarray(20 * np.log10(np.maximum(values, FAINTEST)))
