r"""Physical optics on frozen facets, in the reciprocal form, for two and three dimensions.

Between two antenna ports, a facet of size :math:`\Delta A` with reflection coefficient
:math:`\Gamma` contributes

.. math:: S = \frac{jk}{\lambda} \Gamma\, (\cos\theta_t + \cos\theta_r)\, h_t h_r\, \Delta A
          \operatorname{sinc}(k\,(\hat u_t + \hat u_r)\cdot e / 2)

with the free-space links :math:`h = g\lambda/(4\pi r)\,e^{-jkr}` of both legs, antenna
patterns :math:`g`, and the facet's edge :math:`e`. The usual :math:`2\cos\theta_i` is not
reciprocal. For line facets, the integral along z is done by stationary phase, which gives
the spherical wave of a scene that is invariant along z; the cylindrical wave is that of a
unit line source :math:`G = -\tfrac{j}{4} H_0^{(2)}(kr)`, for comparison with
two-dimensional full-wave solvers.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from estimator.engine import thread_count
from estimator.measurement import Waves
from simulator.facets import Facets
from simulator.frequency_sum import FrequencySum, chebyshev_nodes, nodes_needed

CONDUCTOR = -1.0  # reflection coefficient of the electric field

SERIES_DEGREE = 16
"""Terms of a triangle's transform: corner phases stay below π, and π¹⁷·2/19! is 5e-9."""


Pattern = Callable[
    [Float[np.ndarray, "facets 3"], Float[np.ndarray, " facets"], Float[np.ndarray, " nodes"]],
    Float[np.ndarray, "#nodes facets"] | Complex[np.ndarray, "#nodes facets"],
]
"""Field over that of an isotropic port, from the unit directions that leave the port, the
distances [m] and the frequencies [Hz]; a single row if it does not vary with frequency."""


@dataclass(frozen=True, kw_only=True)
class Ports:
    """Antenna ports at points of space, as the facets see them."""

    positions: Float[np.ndarray, "ports 3"]  # [m]
    pattern: Pattern
    visible: Bool[np.ndarray, "ports facets"]
    nodes: int = 1  # frequencies that the pattern has to be sampled at


def scattered(
    facets: Facets,
    transmit: Ports,
    receive: Ports,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    waves: Waves,
    advance: Callable[[], None] = lambda: None,
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the facets' echoes for each link from a transmitting to a receiving port.

    Parameters
    ----------
    facets
        The frozen surface.
    transmit, receive
        Ports of the links, pairwise; a single transmitter serves all receivers. If both are
        the same object, the links are monostatic.
    frequencies
        Uniform grid. [Hz]
    waves
        Spherical (S-parameters) or cylindrical (fields of a unit line source).
    advance
        Called once for each link that is done.

    Returns
    -------
    S-parameter of each link; with cylindrical waves, field per unit line source. [-]
    """
    band = float(frequencies[-1] - frequencies[0])
    count = nodes_needed(2 * facets.extent / speed_of_light, band)
    count += transmit.nodes + receive.nodes - 2  # degrees of a product add up
    nodes = chebyshev_nodes(float(frequencies[0]), float(frequencies[-1]), count)
    total = FrequencySum(frequencies, nodes)
    shared = _Leg(facets, transmit, 0, nodes) if len(transmit.positions) == 1 else None

    def link(index: int) -> Complex[np.ndarray, " freqs"]:
        inward = shared or _Leg(facets, transmit, index, nodes)
        outward = inward if receive is transmit else _Leg(facets, receive, index, nodes)
        spectrum = _link(facets, inward, outward, total, nodes, waves)
        advance()
        return spectrum

    # Threads change nothing in the result: each link is summed by one of them.
    with ThreadPoolExecutor(thread_count()) as pool:
        return np.stack(list(pool.map(link, range(len(receive.positions)))))


class _Leg:
    """Distances, directions and gains from one port to all facets."""

    def __init__(
        self, facets: Facets, ports: Ports, index: int, nodes: Float[np.ndarray, " nodes"]
    ) -> None:
        towards = ports.positions[index] - facets.centres
        self.distance = np.sqrt(np.einsum("fx,fx->f", towards, towards))
        self.direction = towards / self.distance[:, None]
        self.cosine = np.einsum("fx,fx->f", self.direction, facets.normals)
        self.gain = ports.pattern(-self.direction, self.distance, nodes)
        self.lit = ports.visible[index] & (facets.two_sided | (self.cosine > 0))


def _link(
    facets: Facets,
    inward: _Leg,
    outward: _Leg,
    total: FrequencySum,
    nodes: Float[np.ndarray, " nodes"],
    waves: Waves,
) -> Complex[np.ndarray, " freqs"]:
    # Both ends must see the same side of the facet.
    lit = inward.lit & outward.lit & (inward.cosine * outward.cosine > 0)
    lengths = inward.distance[lit] + outward.distance[lit]
    product = inward.distance[lit] * outward.distance[lit]
    obliquity = np.abs(inward.cosine[lit] + outward.cosine[lit])
    amplitude = CONDUCTOR * obliquity * facets.sizes[lit] / (8 * np.pi)
    gain = inward.gain[:, lit] * outward.gain[:, lit]
    common = np.ones(total.frequencies.size, dtype=np.complex128)
    if facets.edges.shape[1] == 2:  # (jk/λ)(λ/4π)² = j/(8π)
        amplitude, common = amplitude / product, 1j * common
    elif waves == "spherical":  # √(λ/L) e^{jπ/4} times the cylindrical wave
        amplitude = amplitude / np.sqrt(product * lengths)
        common = np.exp(0.25j * np.pi) * np.sqrt(speed_of_light / total.frequencies)
    else:  # jk G² with |G|² = 1/(8πkr)
        amplitude = amplitude / np.sqrt(product)
    slope = (inward.direction[lit] + outward.direction[lit])[:, None, :] * facets.edges[lit]
    advances = slope.sum(axis=-1) / speed_of_light  # along each edge [s]
    shape = facet_transform(2 * np.pi * nodes[:, None, None] * advances)
    spectrum: np.ndarray = common * total(lengths / speed_of_light, amplitude * gain * shape)
    return spectrum


def facet_transform(
    advances: Float[np.ndarray, "nodes facets sides"],
) -> Float[np.ndarray, "nodes facets"] | Complex[np.ndarray, "nodes facets"]:
    r"""Average a linear phase over facets, relative to the phase at their centres.

    A line gives :math:`\operatorname{sinc}(a/2)`. A triangle with corner phases
    :math:`p_i`, :math:`\sum p_i = 0`, gives :math:`\sum_n \frac{2 j^n}{(n+2)!} h_n(p)` with
    the complete homogeneous symmetric polynomials :math:`h_n = -e_2 h_{n-2} + e_3 h_{n-3}`;
    unlike the quotient of exponentials it has no removable poles.

    Parameters
    ----------
    advances
        Phase at the end of each edge, relative to the corner that the edges share. [rad]

    Returns
    -------
    The average of the phase factor; 1 for a facet much smaller than the wavelength. [-]
    """
    if advances.shape[-1] == 1:
        return np.asarray(np.sinc(advances[..., 0] / (2 * np.pi)))
    corners = np.concatenate([np.zeros_like(advances[..., :1]), advances], axis=-1)
    first, second, third = np.moveaxis(corners - corners.mean(axis=-1, keepdims=True), -1, 0)
    pairs = first * second + second * third + third * first
    product = first * second * third
    polynomials = [np.ones_like(first), np.zeros_like(first), -pairs]
    transform = polynomials[0] + 0j
    for degree in range(2, SERIES_DEGREE + 1):
        if degree > 2:
            polynomials.append(-pairs * polynomials[-2] + product * polynomials[-3])
        transform += polynomials[degree] * (2 * 1j**degree / math.factorial(degree + 2))
    return np.asarray(transform)
