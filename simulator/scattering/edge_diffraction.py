r"""Edge diffraction beyond physical optics: the field of the fringe currents (Ufimtsev).

Diffraction at a perfectly conducting wedge with the exterior angle :math:`n\pi` gives, by [1]_,

.. math:: f, g = \frac{\sin(\pi/n)}{n} \left[ \frac{1}{\cos\frac{\pi}{n} - \cos\frac{\varphi -
          \varphi_0}{n}} \mp \frac{1}{\cos\frac{\pi}{n} - \cos\frac{\varphi + \varphi_0}{n}} \right]

f for the electric field along the edge (TM), g for the magnetic one (TE), with angles from one of
its faces through the air. An end of the facets of physical optics, in the reciprocal form
:math:`\cos\theta_t + \cos\theta_r`, already gives :math:`f_0 = -g_0 = \tfrac12 \tan\tfrac12(\varphi
+ \varphi_0)` for each face that both antennas see. The difference is the field of the fringe
currents; it is finite also in the specular direction, where both terms have a pole. A unit line
source at distance r gives :math:`2 (f - f_0)\, G(r)\, G(r')` at :math:`r'`.

In TE the field along a plate does not vanish, and double diffraction between its two ends,
:math:`4\, G(L) / (\cos\tfrac12\varphi_0 \cos\tfrac12\varphi)` for each order, is added. In TM it
is weaker by :math:`1/kL` and left out, as are waves between the corners of a closed body, and
edges of dielectrics, where only physical optics is used. Diffraction around a corner, where only
one antenna sees a face, is left out as well.

References
----------
.. [1] P. Ya. Ufimtsev, "Fundamentals of the Physical Theory of Diffraction", 2nd ed., Wiley 2014,
   doi:10.1002/9781118848678: sections 2.3 to 4.1 (wedge), 5.1 (strip).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Waves
from scenes.schema.radio import Polarization
from simulator.antennas.ports import Ports
from simulator.geometry.facets import Facets
from simulator.geometry.profile_lines import Edge
from simulator.materials.fresnel_slab import Conductor, Material
from simulator.scattering.small_slope_2d import kernels

NUDGE = 1e-6
"""Distance from a pole at which both terms are evaluated instead of at the pole; their difference
changes by a relative amount of this order. [rad]"""


def fringe(
    transmit: Float[np.ndarray, "*n"],
    receive: Float[np.ndarray, "*n"],
    *,
    exterior: float,
    faces: Sequence[bool],
    polarization: Polarization,
) -> Float[np.ndarray, "*n"]:
    """Diffraction coefficient of a wedge minus that of the ends of its facets. [-].

    Parameters
    ----------
    transmit, receive
        Angles to both antennas from the first face, through the air. [rad]
    exterior
        Exterior angle (in air) over π. [-]
    faces
        Whether both antennas see the first face, and the second.
    polarization
        Vertical: the electric field is along the edge.
    """
    opening = exterior * np.pi
    total, apart = transmit + receive, transmit - receive
    poles = [np.pi, 2 * opening - np.pi]
    for pole in poles:
        close = np.abs(total - pole) < NUDGE
        total = np.where(close, pole + NUDGE, total)
    scale, bound = np.sin(np.pi / exterior) / exterior, np.cos(np.pi / exterior)
    incident = scale / (bound - np.cos(apart / exterior))
    reflected = scale / (bound - np.cos(total / exterior))
    sign = 1.0 if polarization == "vertical" else -1.0
    flat = np.zeros_like(total)
    for seen, of_face in zip(faces, (total, 2 * opening - total), strict=False):
        if seen:
            flat = flat + 0.5 * np.tan(0.5 * of_face)
    return np.asarray(incident - sign * reflected - sign * flat)


@dataclass(frozen=True, kw_only=True)
class EdgeView:
    """The edges of a scene as one antenna sees them."""

    directions: Float[np.ndarray, "edges 2"]  # unit vectors to the antenna
    lengths: Float[np.ndarray, " edges"]  # [m]
    gains: Complex[np.ndarray, "#freqs edges"]


def edge_view(
    edges: Sequence[Edge], ports: Ports, port: int, frequencies: Float[np.ndarray, " freqs"]
) -> EdgeView:
    """Return directions and distances of all edges from one port."""
    places = np.array([edge.place for edge in edges])
    towards = ports.positions[port, :2] - places
    lengths = np.hypot(towards[:, 0], towards[:, 1])
    directions = towards / lengths[:, None]
    outward = np.concatenate([-directions, np.zeros((len(edges), 1))], axis=-1)
    gains = np.asarray(ports.pattern(outward, lengths, frequencies)) + 0j
    return EdgeView(directions=directions, lengths=lengths, gains=gains)


def edge_echo(
    edges: Sequence[Edge],
    facets: Facets,
    lit: Bool[np.ndarray, " facets"],
    views: tuple[EdgeView, EdgeView],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    waves: Waves,
) -> Complex[np.ndarray, " freqs"]:
    """Sum the edges' contribution to one link, beyond that of the facets.

    Parameters
    ----------
    edges, facets
        Of a scene in two dimensions.
    lit
        Which facets both antennas see, from the same side.
    views
        From the transmitting and from the receiving port.
    frequencies
        Any grid. [Hz]
    waves
        As for :func:`simulator.scattering.physical_optics.scattered`.
    """
    wavenumber = 2 * np.pi * frequencies / speed_of_light
    sent, heard = views
    lengths, strengths = [], []
    angles: dict[int, tuple[float, float]] = {}
    for index, edge in enumerate(edges):
        faces = [bool(lit[facet]) for facet in edge.facets]
        if not any(faces):
            continue
        ways = sent.directions[index], heard.directions[index]
        back = len(faces) == 1 and ways[0] @ facets.normals[edge.facets[0], :2] < 0
        side = -1.0 if back else 1.0
        strength: np.ndarray | complex = 0j
        material = facets.material_of(edge.facets[0])
        if isinstance(material, Conductor):
            axes = edge.inward[0], side * facets.normals[edge.facets[0], :2]
            both = [float(np.arctan2(way @ axes[1], way @ axes[0])) % (2 * np.pi) for way in ways]
            angles[index] = (both[0], both[1])
            strength += fringe(
                *(np.array(angle) for angle in both),
                exterior=edge.exterior,
                faces=faces,
                polarization=facets.polarization,
            )
        for seen, facet, inward in zip(faces, edge.facets, edge.inward, strict=True):
            if seen and facets.rough[facet]:
                normal = side * facets.normals[facet, :2]
                strength += rough_end(
                    material, ways, inward, normal, frequencies, polarization=facets.polarization
                )
        gain = sent.gains[:, index] * heard.gains[:, index]
        lengths.append([sent.lengths[index], heard.lengths[index], 0.0])
        strengths.append(np.broadcast_to(2 * gain * strength, frequencies.shape))
    if facets.polarization == "horizontal":
        for one, edge in enumerate(edges):
            other = edge.partner
            if one in angles and other in angles:
                falls = np.cos(angles[one][0] / 2) * np.cos(angles[other][1] / 2)
                along = wavenumber * edge.length
                link = -0.25j * np.sqrt(2 / (np.pi * along)) * np.exp(0.25j * np.pi)
                gain = sent.gains[:, one] * heard.gains[:, other]
                lengths.append([sent.lengths[one], heard.lengths[other], edge.length])
                strengths.append(np.broadcast_to(4 * gain * link / falls, frequencies.shape))
    if not lengths:
        return np.zeros(frequencies.size, dtype=np.complex128)
    parts = np.array(lengths)
    total = parts.sum(axis=-1)
    turns = frequencies[:, None] * (total / speed_of_light)
    spread = 1 / np.sqrt(parts[:, 0] * parts[:, 1])
    if waves == "spherical":
        spread = spread / np.sqrt(total)
    carried = np.array(strengths).T * np.exp(-2j * np.pi * (turns - np.rint(turns)))
    # G(r) G(r') of two line sources, as for facets: -j/(8πk)
    spectrum = np.einsum("fe,e->f", carried, spread) * (-1j / (8 * np.pi * wavenumber))
    if waves == "spherical":
        spectrum *= np.exp(0.25j * np.pi) * np.sqrt(speed_of_light / frequencies)
    return np.asarray(spectrum)


def rough_end(
    material: Material,
    ways: tuple[Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]],
    inward: Float[np.ndarray, " 2"],
    normal: Float[np.ndarray, " 2"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    polarization: Polarization,
) -> complex:
    r"""Return the end term of a flat line minus that of a rough line's weights, as a coefficient.

    The weight is :math:`2B/Q` in place of :math:`R\,Q`. A constant weight N that ends at an edge
    radiates like a coefficient :math:`-N / 2 (\hat s_i + \hat s_s)\cdot\hat e`, with
    :math:`\hat e` inward; the difference is finite in the specular direction, where
    :math:`B - KR` vanishes to second order.
    """
    (t_i, q_i), (t_s, q_s) = ((way @ inward, way @ normal) for way in ways)
    centre = np.array([frequencies[frequencies.size // 2]])
    pair = [(np.array([t]), np.array([q])) for t, q in ((t_i, q_i), (t_s, q_s))]
    half = kernels(material, pair[0], pair[1], centre, polarization=polarization, half_space=True)
    along, across = t_i + t_s, q_i + q_s
    reflected = complex(half.mirror[0, 0]) / (0.5 * (along**2 + across**2))
    over = complex(half.bragg[0, 0] - half.mirror[0, 0])
    if abs(along) < NUDGE:
        return 0j
    return complex(0.5 * (2 * over / (across * along) + reflected * along / across))
