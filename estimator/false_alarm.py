r"""How often chance alone may look like a find: every false-alarm rate of the estimator.

The intensity of noise, and of speckle, is exponentially distributed about its mean. Of K
independent cells the brightest passes :math:`\ln(K / P)` times that mean with probability P,
which is what :func:`threshold` returns. Each rate says of what it is the probability: a rate per
pixel may be larger than one per measurement, where many finds must coincide to be believed.

The rates are choices; that chance keeps to them is measured by
``python -m validation.experiments.thresholds``.
"""

import numpy as np

PIXEL = 1e-6
"""That a pixel of pure background counts as a peak of an echo's image. An image has some 1e5
pixels: one in ten shows a false peak, and a wall takes several peaks in line. [per pixel]"""

PLANE = 1e-3
"""That peaks strewn at random make any plane of those that are tried. [per search]"""

WALL = 1e-3
"""That background alone is as bright along any of the lines or planes tried as a fitted wall is:
walls with a confidence below one minus this are not reported. [per image]"""

TARGET = 1e-3
"""Targets that noise alone makes, in the mean. [per image]"""

WAVE = 1e-6
"""That noise alone gives a wave somewhere in a user's angle/range map. A wave that is none becomes
a position, hence less than for walls, on which others must agree. [per pilot]"""

PATH = 1e-3
"""The default of :func:`estimator.channel.relax.extract_paths`: that noise alone gives any path.
[per pilot]"""

DISAGREEMENT = 1e-3
"""That errors within their covariances fail a χ² test of whether estimates agree. [per test]"""

EXCESS = 1e-2
"""That the phase errors of noise alone count as more than noise; a false alarm only widens the
covariance of a wave. [per wave]"""


def threshold(rate: float, *, cells: int | float = 1) -> float:
    """Return the intensity, over the mean of noise, that is passed with some probability.

    Parameters
    ----------
    rate
        Probability that any of the cells passes it. [-]
    cells
        Independent cells that are looked at. [-]

    Returns
    -------
    ln(cells / rate), exact for small rates. [-]
    """
    return float(np.log(cells / rate))
