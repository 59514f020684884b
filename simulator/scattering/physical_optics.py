r"""Physical optics on frozen facets, in the reciprocal form, for two and three dimensions.

Between two antenna ports, a facet of size :math:`\Delta A` with reflection coefficient
:math:`\Gamma` contributes

.. math:: S = \frac{jk}{\lambda} \Gamma\, (\cos\theta_t + \cos\theta_r)\, h_t h_r\, \Delta A
          \operatorname{sinc}(k\,(\hat u_t + \hat u_r)\cdot e / 2)

with the free-space links :math:`h = g\lambda/(4\pi r)\,e^{-jkr}` of both legs, antenna
patterns :math:`g`, and the facet's edge :math:`e`; :math:`\Gamma` is that of
:mod:`simulator.materials.facet_reflection`. The usual :math:`2\cos\theta_i` is not
reciprocal. For line facets, the integral along z is done by stationary phase, which gives
the spherical wave of a scene that is invariant along z; the cylindrical wave is that of a
unit line source :math:`G = -\tfrac{j}{4} H_0^{(2)}(kr)`, for comparison with
two-dimensional full-wave solvers.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from estimator.compute.engine import thread_count
from estimator.measurement.model import Waves
from simulator.antennas.ports import Ports, isotropic
from simulator.geometry.facets import Facets
from simulator.materials.fresnel_slab import Absorber, Conductor
from simulator.numerics.nufft_sum import FrequencySum, chebyshev_nodes, nodes_needed
from simulator.scattering.edge_diffraction import edge_echo, edge_view
from simulator.scattering.facet_weights import Leg, MaterialPart
from simulator.scattering.triangle_transform import triangle_transform

SAMPLES_AT_ONCE = 4_000_000
"""Facets times nodes evaluated in one batch: 64 MB for each complex quantity. [-]"""

FEWEST_FOR_KERNEL = 200_000
"""Fewest triangles times links at which compiling the kernel (a third of a second) saves time.
[-]"""

TRIANGLE_ACCURACY = 8e-4
"""Interpolation error over the band of the phase factor at a triangle's farthest corner. In the
average over the triangle, at most an eighth of it remains in second order and a fortieth in third,
by the moments of its points about the centroid. [-]"""

MOST_TRIED, MARGIN = 16, 1.1
"""Links at which the facets' delay slopes are evaluated, and the factor by which those of other
links may exceed them. [-]"""


def scattered(
    facets: Facets,
    transmit: Ports,
    receive: Ports,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    waves: Waves,
    advance: Callable[[], None] = lambda: None,
) -> Complex[np.ndarray, "links freqs"]:
    """Sum the facets' scattering for each link from a transmitting to a receiving port.

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
        Called after each link.

    Returns
    -------
    S-parameter of each link; with cylindrical waves, field per unit line source. [-]
    """
    monostatic = receive is transmit
    start, stop = float(frequencies[0]), float(frequencies[-1])
    count = nodes_needed(2 * facets.extent / speed_of_light, stop - start)
    count += transmit.nodes + receive.nodes - 2  # degrees of a product add up
    parts = [
        MaterialPart(facets, group, count, frequencies, monostatic=monostatic)
        for group in facets.by_material
        if not isinstance(group.material, Absorber)
    ]
    if _suits_the_kernel(facets, transmit, receive, parts):
        return _by_kernel(facets, transmit, receive, parts, frequencies, advance)
    shared = Leg(facets, transmit, 0) if len(transmit.positions) == 1 else None
    sent_view = None
    if shared is not None and facets.corners:
        sent_view = edge_view(facets.corners, transmit, 0, frequencies)

    def link(index: int) -> Complex[np.ndarray, " freqs"]:
        inward = shared or Leg(facets, transmit, index)
        outward = inward if monostatic else Leg(facets, receive, index)
        # Both ends must see the same side of the facet.
        lit = inward.lit & outward.lit & (inward.facing * outward.facing > 0)
        spectrum = np.zeros(frequencies.size, dtype=np.complex128)
        for part in parts:
            chosen = lit if part.mask is None else lit & part.mask
            spectrum += _partial_link(facets, chosen, inward, outward, part, waves)
        if facets.corners:
            view = edge_view(facets.corners, receive, index, frequencies)
            if monostatic:
                views = view, view
            else:
                views = (
                    sent_view or edge_view(facets.corners, transmit, index, frequencies),
                    view,
                )
            spectrum += edge_echo(facets.corners, facets, lit, views, frequencies, waves=waves)
        advance()
        return spectrum

    # The number of threads does not change the result: each link is summed by one thread.
    with ThreadPoolExecutor(thread_count()) as pool:
        return np.stack(list(pool.map(link, range(len(receive.positions)))))


def _suits_the_kernel(
    facets: Facets, transmit: Ports, receive: Ports, parts: list[MaterialPart]
) -> bool:
    """Return whether these are many triangles whose reflection is constant over the band."""
    many = not facets.flat and facets.count * len(receive.positions) >= FEWEST_FOR_KERNEL
    alike = all(part.monostatic or isinstance(part.material, Conductor) for part in parts)
    return many and alike and transmit.nodes == receive.nodes == 1


def _by_kernel(
    facets: Facets,
    transmit: Ports,
    receive: Ports,
    parts: list[MaterialPart],
    frequencies: Float[np.ndarray, " freqs"],
    advance: Callable[[], None],
) -> Complex[np.ndarray, "links freqs"]:
    from simulator.scattering.facet_kernel import FacetKernel, Weights, sum_links

    monostatic, count = receive is transmit, len(receive.positions)
    senders = np.zeros(count, dtype=int) if len(transmit.positions) == 1 else np.arange(count)
    pairs = [
        (transmit.positions[sender], receive.positions[index])
        for index, sender in enumerate(senders)
    ]
    kernel = FacetKernel(facets, transmit.polarization, receive.polarization)
    some = np.unique(np.linspace(0, count - 1, MOST_TRIED).round().astype(int))
    spread = MARGIN * kernel.typical_advance([pairs[index] for index in some])
    start, stop = float(frequencies[0]), float(frequencies[-1])
    nodes = chebyshev_nodes(
        start, stop, nodes_needed(spread, stop - start, accuracy=TRIANGLE_ACCURACY)
    )
    total = FrequencySum(frequencies, nodes)

    def gain(ports: Ports, index: int) -> Float[np.ndarray, " facets"] | None:
        if ports.pattern is isotropic:
            return None
        leg = Leg(facets, ports, index)
        return np.asarray(ports.pattern(-leg.direction, leg.distance, nodes)[0].real)

    spectrum = np.zeros((count, frequencies.size), dtype=np.complex128)
    for part in parts:

        def weights(index: int, part: MaterialPart = part) -> Weights:
            sender = int(senders[index])
            lit = transmit.visible[sender]
            lit = lit if monostatic else lit & receive.visible[index]
            lit = lit if part.mask is None else lit & part.mask
            one = gain(transmit, sender)
            other = one if monostatic else gain(receive, index)
            both = other if one is None else one if other is None else one * other
            return Weights(
                lit=lit,
                gain=both,
                material=part.material,
                permittivity=part.permittivity,
                share=part.share,
            )

        def told(part: MaterialPart = part) -> None:
            if part is parts[-1]:
                advance()

        sums = sum_links(kernel, pairs, weights, total, monostatic=monostatic, advance=told)
        # The kernel's coefficient is -1; one that is common to all facets replaces it.
        spectrum += sums if part.common is None else -part.common * sums
    return 1j * spectrum


def _partial_link(
    facets: Facets,
    chosen: Bool[np.ndarray, " facets"],
    inward: Leg,
    outward: Leg,
    part: MaterialPart,
    waves: Waves,
) -> Complex[np.ndarray, " freqs"]:
    lit = np.flatnonzero(chosen)
    add_up = part.total(inward, outward, lit)
    nodes = add_up.nodes
    total = np.zeros(part.frequencies.size, dtype=np.complex128)
    at_once = max(1, SAMPLES_AT_ONCE // nodes.size)
    for first in range(0, len(lit), at_once):
        some = lit[first : first + at_once]
        one, sent = inward.distance[some], inward.direction[some]
        other, heard = one, sent
        if outward is not inward:
            other, heard = outward.distance[some], outward.direction[some]
        lengths, product = one + other, one * other
        amplitude = facets.sizes[some] / (8 * np.pi)
        if not facets.flat:  # (jk/λ)(λ/4π)² = j/(8π)
            amplitude = amplitude / product
        elif waves == "spherical":  # √(λ/L) e^{jπ/4} times the cylindrical wave
            amplitude = amplitude / np.sqrt(product * lengths)
        else:  # jk G² with |G|² = 1/(8πkr)
            amplitude = amplitude / np.sqrt(product)
        gain = inward.gain(some, nodes)
        gain = gain * (gain if outward is inward else outward.gain(some, nodes))
        slope = (sent + heard)[:, None, :] * facets.edges[some]
        advances = slope.sum(axis=-1) / speed_of_light  # along each edge [s]
        shape = facet_transform(2 * np.pi * nodes[:, None, None] * advances)
        shape = shape * part.weights(inward, outward, some, nodes, facets)
        total += add_up(lengths / speed_of_light, amplitude * gain * shape)
    if part.common is not None:
        total *= part.common
    if not facets.flat:
        return 1j * total
    if waves == "spherical":
        total = np.exp(0.25j * np.pi) * np.sqrt(speed_of_light / part.frequencies) * total
    return total


def facet_transform(
    advances: Float[np.ndarray, "nodes facets sides"],
) -> Float[np.ndarray, "nodes facets"] | Complex[np.ndarray, "nodes facets"]:
    r"""Average a linear phase over facets, relative to the phase at their centres.

    A line gives :math:`\operatorname{sinc}(a/2)`, a triangle the series of
    :mod:`simulator.scattering.triangle_transform`.

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
    re, im = triangle_transform(advances[..., 0], advances[..., 1])
    return np.asarray(re + 1j * im)
