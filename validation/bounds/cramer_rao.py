r"""Cramér-Rao bounds of angle and path length, near field and wide band, gain unknown.

One spherical wave of unknown complex gain g in white circular noise of variance σ²,

.. math:: u_{mn} = g \frac{R}{r_m} e^{-j k_n r_m}, \qquad
          r_m = \lVert R\,\hat s(\theta) - q_m \rVert .

With the power :math:`w_{mn} = |u_{mn}|^2` and the phases' slopes :math:`\psi_i = k_n
\partial r_m / \partial p_i` its Fisher information, the gain eliminated, is

.. math:: F_{ij} = \frac{2}{\sigma^2} \left[ \sum w \psi_i \psi_j
          - \frac{(\sum w \psi_i)(\sum w \psi_j)}{\sum w} \right] .

The amplitudes' own dependence on the parameters adds a share of 1/(kR)² and is left out.
"""

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light


def cramer_rao_bound(
    *,
    aoa: float,
    path_length: float,
    snr: float,
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Float[np.ndarray, "2 2"]:
    """Return the smallest covariance of (angle [rad], path length [m]) without bias.

    Parameters
    ----------
    aoa
        Angle from +x. [rad]
    path_length
        From the origin. [m]
    snr
        Mean power over all samples over the noise's variance (not in dB). [-]
    positions
        Elements, in the plane z = 0, with the origin at their centre. [m]
    frequencies
        [Hz]
    """
    towards = np.array([np.cos(aoa), np.sin(aoa), 0.0])
    turned = np.array([-np.sin(aoa), np.cos(aoa), 0.0])
    rays = path_length * towards - positions
    distance = np.linalg.norm(rays, axis=1)
    wavenumber = 2 * np.pi * frequencies / speed_of_light
    power = np.broadcast_to(
        (path_length / distance)[:, None] ** 2, (len(positions), wavenumber.size)
    )
    power = power * (snr / power.mean())
    slopes = np.stack(
        [
            np.outer(path_length * (rays @ turned) / distance, wavenumber),
            np.outer((rays @ towards) / distance, wavenumber),
        ]
    )
    means = (power * slopes).sum(axis=(1, 2)) / power.sum()
    centred = slopes - means[:, None, None]
    information = 2 * np.einsum("mn,imn,jmn->ij", power, centred, centred)
    return np.asarray(np.linalg.inv(information))
