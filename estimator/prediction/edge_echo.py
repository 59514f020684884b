r"""The echo of a plate's edge to an array far from it: Keller's diffraction by a half plane.

A plate whose reflection misses the array shows it no more than its two edges. An upright edge at
the distance r, with the plate seen at the angle :math:`\varphi` from its face, returns

.. math:: |s| = \frac{\lambda}{4 \pi} \frac{|D|}{\sqrt{2 r^3}}, \qquad
          |D| = \frac{1}{\sqrt{2 \pi k}} \cdot \tfrac12 \left| -1 \pm \frac{1}{\cos\varphi} \right|

(J. B. Keller, "Geometrical theory of diffraction", J. Opt. Soc. Am. 52, 1962, with the incident
and the diffracted ray alike): plus with the electric field along the edge, minus across it. A plate
that reflects by :math:`\Gamma` has about :math:`|\Gamma| / (2 |\cos\varphi|)`, physical optics'
share of it. The formula fails where the plate faces the array, :math:`\varphi = 90°`.
"""

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

FACING = 0.02
"""Least cosine of the angle from the face: the beam of a plate of half the aperture's size that
faces the array is as wide. [-]"""
LEAST = 1e-6
"""Least coefficient, so that its logarithm stays finite. [-]"""


def edge_echoes_db(edges: Float[np.ndarray, "2 3"], frequency: float) -> Float[np.ndarray, "3 2"]:
    """Return the levels of the echoes from the two upright edges of a smooth plate.

    Parameters
    ----------
    edges
        Where they are seen, from an array of isotropic antennas at the origin. [m]
    frequency
        Centre of the band. [Hz]

    Returns
    -------
    20 log10 of S-parameters: of a conductor with the field along the edges, of one with the field
    across them, and of a plate with a small reflection coefficient, over that coefficient. [dB]

    Example
    -------
    >>> import numpy as np
    >>> edges = np.array([[-0.1, 0.6, 0.0], [0.1, 0.9, 0.0]])
    >>> edge_echoes_db(edges, 260e9).round(1)
    array([[-121.1, -151.8],
           [-137.3, -127.3],
           [-125.9, -132.8]])
    """
    distance = np.linalg.norm(edges, axis=-1)
    into = edges[::-1] - edges
    into /= np.linalg.norm(into, axis=-1, keepdims=True)
    cosine = -np.sum(into * edges, axis=-1) / distance
    cosine = np.copysign(np.maximum(np.abs(cosine), FACING), cosine)
    wavelength = speed_of_light / frequency
    diffraction = 0.5 * np.abs(np.stack([-1 + 1 / cosine, -1 - 1 / cosine, 1 / cosine]))
    spread = wavelength / (4 * np.pi) * np.sqrt(wavelength) / (2 * np.pi) / np.sqrt(2 * distance**3)
    return np.asarray(20 * np.log10(np.maximum(diffraction, LEAST) * spread))
