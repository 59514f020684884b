r"""Mean scattering of a rough plate between two antennas, in closed form.

The Kirchhoff approximation with Gaussian heights and a Gaussian correlation [1]_, for antennas at
finite distances: for the link

.. math:: S = \frac{jk}{\lambda} \int \Gamma\, (\hat n \cdot \mathbf q)\, h_t h_r\,
          e^{jk q_z \zeta}\, dA, \qquad
          \mathbf q = \hat u_t + \hat u_r, \quad h = \frac{g \lambda}{4 \pi r} e^{-jkr}

the mean is that of the smooth plate times :math:`e^{-s/2}`, :math:`s = k^2 q_z^2 \sigma^2`. The
slopes in :math:`\hat n` are integrated by parts, which turns :math:`\hat n \cdot \mathbf q`
into :math:`|\mathbf q|^2 / q_z`, and the mean power of the remaining, diffuse part is

.. math:: \langle |S_d|^2 \rangle = \int \Bigl|\frac{k}{\lambda} \Gamma
          \frac{|\mathbf q|^2}{q_z} h_t h_r\Bigr|^2 B \, dA, \qquad
          B = \pi l^2 e^{-s} \sum_{n \ge 1} \frac{s^n}{n!\, n}
          e^{-k^2 q_\parallel^2 l^2 / 4n}

For :math:`s \ll 1` the first term dominates, :math:`B = (2\pi)^2 k^2 q_z^2 W(k q_\parallel)` with
the spectrum :math:`W` of the heights: Bragg scattering. Its weight is that of small perturbations
(Rice 1951), of which the tangent plane's :math:`\Gamma |\mathbf q|^2 / q_z` is the limit of long
correlation lengths.

References
----------
.. [1] P. Beckmann, A. Spizzichino, "The Scattering of Electromagnetic Waves from Rough
   Surfaces", Pergamon, 1963, chapter 5.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from scenes.schema.antenna import Antenna
from scenes.schema.objects import Plate
from scenes.schema.roughness import Roughness
from simulator.antennas.field_pattern import field_gain
from simulator.antennas.polarization import VERTICAL
from simulator.materials.facet_reflection import Legs, facet_coefficients
from simulator.materials.fresnel_slab import Material
from simulator.scattering.weighted_curvature_3d import middle_permittivity, scattering_kernel

TERMS = 30
"""Terms of the series: for s below 5 the remainder is below 1e-12. [-]"""


@dataclass(frozen=True, kw_only=True)
class Antennas:
    """The two ends of a link."""

    transmit_position: Float[np.ndarray, " 3"]  # [m]
    receive_position: Float[np.ndarray, " 3"]  # [m]
    transmit_aim: Float[np.ndarray, " 3"]
    receive_aim: Float[np.ndarray, " 3"]
    transmit: Antenna
    receive: Antenna


def mean_diffuse_power(
    plate: Plate,
    roughness: Roughness,
    material: Material,
    antennas: Antennas,
    frequency: float,
    *,
    cells: int = 150,
) -> float:
    """Average the diffuse power of one link over realisations of the roughness.

    Parameters
    ----------
    plate
        With a height; its own roughness is not used.
    roughness
        Gaussian.
    material
        Of the plate; see :mod:`simulator.materials.facet_reflection`.
    antennas
        Both ends.
    frequency
        [Hz].
    cells
        Cells of the integral along each side: only beams and directions vary over the plate. [-]

    Returns
    -------
    Mean of the squared S-parameter without its mean. [-]
    """
    wavelength = speed_of_light / frequency
    wavenumber = 2 * math.pi / wavelength
    size = np.array([plate.length_m, float(plate.height_m or 0.0)])
    steps = (np.arange(cells) + 0.5) / cells - 0.5
    places = (
        plate.centre
        + size[0] * steps[:, None, None] * plate.tangent
        + size[1] * steps[None, :, None] * np.array([0.0, 0.0, 1.0])
    ).reshape(-1, 3)
    amplitude = np.full(len(places), wavenumber / wavelength)
    towards = []
    for position, aim, antenna in (
        (antennas.transmit_position, antennas.transmit_aim, antennas.transmit),
        (antennas.receive_position, antennas.receive_aim, antennas.receive),
    ):
        offset = position - places
        distance = np.linalg.norm(offset, axis=-1)
        direction = offset / distance[:, None]
        gain = field_gain(antenna, aim, -direction)
        amplitude *= gain * wavelength / (4 * math.pi * distance)
        towards.append(direction)
    both = towards[0] + towards[1]
    across = both @ plate.normal
    along_squared = np.einsum("fx,fx->f", both, both) - across**2
    tuned = np.array([frequency])
    fields = VERTICAL.field(-towards[0]), VERTICAL.field(-towards[1])
    mirror = facet_coefficients(material, towards[0], towards[1], tuned, fields=fields)[0]
    roughened = (wavenumber * across * roughness.rms) ** 2
    length = roughness.correlation_length
    order = np.arange(1, TERMS + 1)[:, None]
    factorial = np.array([math.factorial(int(n)) for n in order[:, 0]], dtype=np.float64)[:, None]
    series = roughened**order / (factorial * order)
    series *= np.exp(-(along_squared * (wavenumber * length) ** 2) / (4 * order))
    spectrum = math.pi * length**2 * np.exp(-roughened) * series.sum(axis=0)
    area = float(size.prod()) / len(places)
    tangent = 0.5 * (along_squared + across**2) * mirror
    legs = Legs(towards[0].T, towards[1].T, fields[0].T, fields[1].T)
    permittivity = middle_permittivity(material, frequency, frequency)
    facing = plate.normal * np.sign(float(np.median(across)))
    bragg = tangent + scattering_kernel(material, legs, permittivity)(facing)
    first = roughened * np.exp(-roughened - along_squared * (wavenumber * length) ** 2 / 4)
    first = math.pi * length**2 * first
    power = np.abs(bragg) ** 2 * first + np.abs(tangent) ** 2 * (spectrum - first)
    return float(np.sum(np.abs(2 * amplitude / across) ** 2 * power) * area)


def coherent_loss(
    plate: Plate, roughness: Roughness, antennas: Antennas, frequency: float
) -> float:
    r"""Return the mean field over that of a smooth plate, :math:`e^{-s/2}` at the centre. [-]."""
    across = 0.0
    for position in (antennas.transmit_position, antennas.receive_position):
        offset = position - plate.centre
        across += abs(float(offset @ plate.normal)) / float(np.linalg.norm(offset))
    wavenumber = 2 * math.pi * frequency / speed_of_light
    return math.exp(-0.5 * (wavenumber * across * roughness.rms) ** 2)


def mirror_link(plate: Plate, antennas: Antennas, frequency: float) -> complex:
    r"""Return the link over an infinite conducting mirror in the plate's plane.

    .. math:: S = -g_t g_r \frac{\lambda}{4 \pi L} e^{-jkL}

    with L the distance from the transmitter's image, between vertical antennas and an upright
    mirror at their own height.
    """
    normal, centre = plate.normal, plate.centre

    def mirrored(point: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
        return np.asarray(point - 2 * ((point - centre) @ normal) * normal)

    way = antennas.receive_position - mirrored(antennas.transmit_position)
    length = float(np.linalg.norm(way))
    direction = way / length
    departure = direction - 2 * (direction @ normal) * normal
    gains = field_gain(antennas.transmit, antennas.transmit_aim, departure[None]) * field_gain(
        antennas.receive, antennas.receive_aim, -direction[None]
    )
    wavelength = speed_of_light / frequency
    turns = length / wavelength
    link = -float(gains[0]) * wavelength / (4 * math.pi * length)
    return complex(link * np.exp(-2j * math.pi * (turns - round(turns))))
