r"""Cramér-Rao bounds of angle and path length, near field and wide band, gain unknown.

One spherical wave of unknown complex gain g in white circular noise of variance σ²,

.. math:: u_{mn} = g \frac{R}{r_m} e^{-j k_n r_m}, \qquad
          r_m = \lVert R\,\hat s(\theta) - q_m \rVert .

With the power :math:`w_{mn} = |u_{mn}|^2` and the phases' slopes :math:`\psi_i = k_n
\partial r_m / \partial p_i` its Fisher information, the gain eliminated, is

.. math:: F_{ij} = \frac{2}{\sigma^2} \left[ \sum w \psi_i \psi_j
          - \frac{(\sum w \psi_i)(\sum w \psi_j)}{\sum w} \right] .

The amplitudes' own dependence on the parameters adds a share of 1/(kR)² and is left out;
:func:`numerical_fisher` keeps it, and knows nothing of these formulas.
"""

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light


def spherical_wave(
    parameters: Float[np.ndarray, " 4"],
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, "elements freqs"]:
    """Evaluate the model for (angle [rad], path length [m], Re g, Im g).

    Angles are from +x in the plane z = 0, lengths from the origin.
    """
    aoa, path_length, re, im = parameters
    source = path_length * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    distance = np.linalg.norm(source - positions, axis=1)
    turns = np.outer(distance, frequencies / speed_of_light)
    wave = (path_length / distance)[:, None] * np.exp(-2j * np.pi * turns)
    return np.asarray((re + 1j * im) * wave)


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


def numerical_fisher(
    parameters: Float[np.ndarray, " 4"],
    *,
    noise_variance: float,
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Float[np.ndarray, "4 4"]:
    """Return the Fisher information of the whole model by central differences.

    Parameters
    ----------
    parameters
        Angle [rad], path length [m], real and imaginary part of the gain.
    noise_variance
        Per complex sample. [-]
    positions, frequencies
        Elements [m] and sweep [Hz].
    """
    wavenumber = 2 * np.pi * float(frequencies[-1]) / speed_of_light
    size = float(np.abs(parameters[2] + 1j * parameters[3]))
    reach = float(np.abs(positions).max())
    # Steps that turn no phase by more than 1e-3: the differences err by a part in 1e6.
    steps = np.array([1e-3 / (wavenumber * reach), 1e-3 / wavenumber, 1e-4 * size, 1e-4 * size])
    slopes = []
    for index, step in enumerate(steps):
        move = np.zeros(4)
        move[index] = step
        ahead = spherical_wave(parameters + move, positions, frequencies)
        behind = spherical_wave(parameters - move, positions, frequencies)
        slopes.append((ahead - behind).ravel() / (2 * step))
    jacobian = np.stack(slopes)
    return np.asarray(2 / noise_variance * (jacobian.conj() @ jacobian.T).real)


def broadside_range_bound(*, bandwidth: float, samples: int, snr: float) -> float:
    """Return the textbook bound of the range's deviation for a distant source, in metres.

    c / (2π B/√12 √(2 MN SNR)), for a uniform sweep of bandwidth B in hertz.
    """
    rms_bandwidth = bandwidth / np.sqrt(12)
    return float(speed_of_light / (2 * np.pi * rms_bandwidth * np.sqrt(2 * samples * snr)))
