"""Antenna patterns: real field amplitude over direction, relative to isotropic (0 dBi).

A pattern has a main beam that is rotationally symmetric about the antenna's aim and does not
vary with frequency; polarization is that of :mod:`simulator.antennas.polarization`. In two
dimensions directions have z = 0.
"""

import math

import numpy as np
from jaxtyping import Float

from scenes.schema.antenna import Antenna, Cosine, GaussianBeam, Horn, Isotropic


def field_gain(
    antenna: Antenna, aim: Float[np.ndarray, "*#n 3"], directions: Float[np.ndarray, "*n 3"]
) -> Float[np.ndarray, "*n"]:
    """Field amplitude that an antenna radiates into, or receives from, each direction.

    Parameters
    ----------
    antenna
        Kind of antenna and its parameters.
    aim
        Where the antenna looks, or each of several; of any length.
    directions
        Unit vectors from the antenna outward.

    Returns
    -------
    Amplitude relative to an isotropic antenna; its square is the gain. [-]

    Raises
    ------
    ValueError
        If the aim has no direction.
    """
    if isinstance(antenna, Isotropic):
        return np.ones(directions.shape[:-1])
    length = np.linalg.norm(aim, axis=-1, keepdims=True)
    if not np.all(np.isfinite(length) & (length > 0)):
        raise ValueError(
            f"the antenna's aim {aim.tolist()} has no direction; "
            "aim it at a point other than its own position"
        )
    axis = aim / length
    # Written out: a matrix product's rounding depends on the number of threads.
    cosine = (
        directions[..., 0] * axis[..., 0]
        + directions[..., 1] * axis[..., 1]
        + directions[..., 2] * axis[..., 2]
    )
    cosine_off_axis = np.clip(cosine, -1.0, 1.0)
    match antenna:
        case GaussianBeam():
            return gaussian_beam(np.arccos(cosine_off_axis), sigma=antenna.sigma_rad)
        case Cosine():
            return cosine_power(cosine_off_axis, exponent=antenna.exponent)
        case Horn():
            return horn(np.arccos(cosine_off_axis), gain_dbi=antenna.gain_dbi)


def gaussian_beam(off_axis: Float[np.ndarray, "*n"], *, sigma: float) -> Float[np.ndarray, "*n"]:
    r"""Field of a Gaussian beam, Eq. (4-1) of the thesis with the exponent corrected.

    .. math:: g(\psi) = e^{-\psi^2 / 2 \sigma^2}

    Only the pattern: the peak amplitude is 1 (0 dBi) whatever the width, so that narrowing
    the beam does not change the level on its axis. A horn of that width would have some
    :math:`4/\sigma^2` of gain; use :func:`horn` for a level to be compared with a measurement.

    Parameters
    ----------
    off_axis
        Angle between direction and aim, 0…π. [rad]
    sigma
        Standard width of the field pattern. [rad]
    """
    return np.exp(-0.5 * (off_axis / sigma) ** 2)


def cosine_power(
    cosine_off_axis: Float[np.ndarray, "*n"], *, exponent: float
) -> Float[np.ndarray, "*n"]:
    r"""Field of a lossless antenna with the power pattern cos^q in front and nothing behind.

    .. math:: g(\psi) = \sqrt{2 (q + 1) \cos^q \psi}, \qquad \psi < \pi/2

    so that the gain :math:`g^2` integrates to :math:`4\pi` over the sphere.

    Parameters
    ----------
    cosine_off_axis
        Cosine of the angle between direction and aim. [-]
    exponent
        :math:`q` of the power pattern; 0 is a uniform half space (3 dBi). [-]
    """
    front = np.maximum(cosine_off_axis, 0.0)
    amplitude = math.sqrt(2.0 * (exponent + 1.0)) * front ** (0.5 * exponent)
    return np.where(cosine_off_axis > 0, amplitude, 0.0)


def horn(off_axis: Float[np.ndarray, "*n"], *, gain_dbi: float) -> Float[np.ndarray, "*n"]:
    r"""Field of a horn, by its gain: the main beam as a Gaussian.

    .. math:: g(\psi) = \sqrt{G} \, e^{-\psi^2 / 2 \sigma^2}, \qquad
              \sigma = \frac{\Theta}{2 \sqrt{\ln 2}}, \qquad \Theta = \frac{\pi}{\sqrt{G}}

    with the half-power beam width after :func:`horn_beam_width`. The main beam holds
    :math:`\pi^2 / (16 \ln 2)` = 89 % of the radiated power; the side lobes that hold the rest
    in a real horn, 20 dB and more down, are left out.

    Parameters
    ----------
    off_axis
        Angle between direction and aim, 0…π. [rad]
    gain_dbi
        Gain on the axis, over isotropic. [dB]
    """
    peak = 10.0 ** (gain_dbi / 20.0)
    field: np.ndarray = peak * gaussian_beam(off_axis, sigma=horn_beam_sigma(gain_dbi))
    return field


def horn_beam_sigma(gain_dbi: float) -> float:
    """Return the standard width of a horn's field pattern, see :func:`horn`. [rad]."""
    return horn_beam_width(gain_dbi) / (2.0 * math.sqrt(math.log(2.0)))


def horn_beam_width(gain_dbi: float) -> float:
    r"""Half-power beam width of a horn, in radians, from its gain in dBi.

    :math:`G = 32400 / \Theta^2` with :math:`\Theta` in degrees, that is
    :math:`\Theta = \pi / \sqrt{G}` in radians, equal in both planes: 12.7° for 23 dBi. The
    lossless limit of a beam without side lobes would be 36 400 [1]_.

    References
    ----------
    .. [1] C.-T. Tai and C. S. Pereira, "An approximate formula for calculating the
       directivity of an antenna", IEEE Trans. Antennas Propag., 1976, 24(2), 235-236.
    """
    return float(np.pi * 10.0 ** (-gain_dbi / 20.0))
