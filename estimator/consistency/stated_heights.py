r"""A pilot's elements that stand above or below the plane of the echo's array.

A linear array's answer lies in its plane. Two lines at a distance h across that plane have two:
lengths to one of them differ by :math:`h^2 / 2L`.
"""

import numpy as np

from estimator.measurement.model import Uplink


def height_error(uplink: Uplink, path_length: float) -> float:
    """Return by how much a length to a pilot's elements is undetermined. [m].

    Parameters
    ----------
    uplink
        In the frame of the echo's array.
    path_length
        Of the path. [m]
    """
    height = float(np.abs(uplink.positions[:, 2]).max())
    return float(np.hypot(height, path_length)) - path_length
