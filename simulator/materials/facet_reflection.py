r"""What facets reflect: Fresnel coefficients at the half angle, between polarized antennas.

Seen from both of its ends, a facet acts as the mirror that would lead from one to the other:
its angle of incidence is half the angle between the legs, :math:`\cos\vartheta =
|\hat u_t + \hat u_r| / 2` with unit vectors from the facet to the antennas. On the mirror's
lobe this is the angle of incidence itself; elsewhere it is the one choice that depends on
both legs alike, so that the link stays reciprocal. An echo to where it came from is thus
reflected as at normal incidence, by the little mirrors that face the antenna.

In two dimensions the electric field is along z, across the plane of incidence (TE), or the magnetic
one is (TM). In three, the antennas' fields :math:`\hat e` are split at that mirror,

.. math:: \Gamma = (\hat e_r \cdot \hat s)(\hat s \cdot \hat e_t)\, \Gamma_{TE}
                 + (\hat e_r \cdot \hat p_r)(\hat p_t \cdot \hat e_t)\, \Gamma_{TM}

with :math:`\hat s` across both legs and :math:`\hat p = \hat k \times \hat s`. The shares'
difference, what a conductor reflects, is :math:`2 (\hat m \cdot \hat e_t)(\hat m \cdot \hat e_r)
- \hat e_t \cdot \hat e_r` with the mirror's normal :math:`\hat m`: smooth also where the legs are
one, and the shares themselves do not matter.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from scenes.schema.radio import Polarization as Polarization2D
from simulator.materials.fresnel_slab import Coefficients, Conductor, Material, reflection
from simulator.materials.permittivity import MaterialError
from simulator.numerics.nufft_sum import ACCURACY, barycentric_basis, chebyshev_nodes
from simulator.numerics.vectors import Vector, at_least, cross, dot

NODE_COUNTS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 96, 128, 160, 192)
"""Frequencies that a coefficient may be sampled at; the fewest that do are taken."""

COARSEST = 1e-4
"""Error that is put up with at the most nodes: a table's kinks converge slowly. [-]"""

STEEP = 0.1
"""Cosine of incidence down to which a slab has to be followed: 84°. [-]"""

ANGLE_CLASSES = (0.02, 0.05, STEEP, 0.2, 0.35, 0.5, 0.7, 0.85)
"""Most grazing cosines that links are sorted by, each with its number of nodes. [-]"""

LEAST_TURN = 1e-12
"""Squared sine between the legs below which they are one: TE and TM are then the same. [-]"""


class Legs(NamedTuple):
    """Unit vectors from facets to both antennas, and their fields' vectors, by axis."""

    transmit: Vector
    receive: Vector
    sent: Vector
    received: Vector


class Shares(NamedTuple):
    """Share of a link that each polarization carries, with its sign."""

    te: Any
    tm: Any


def half_angle_cosine(
    transmit: Float[np.ndarray, "facets 3"], receive: Float[np.ndarray, "facets 3"]
) -> Float[np.ndarray, " facets"]:
    """Cosine of half the angle between the directions to both antennas. [-]."""
    both = transmit + receive
    return np.asarray(np.minimum(0.5 * np.sqrt(np.einsum("fx,fx->f", both, both)), 1.0))


def mirror_shares(legs: Legs) -> Shares:
    """Split links at the mirror between their legs. [-].

    For arrays of NumPy and Dr.Jit alike.
    """
    across = cross(legs.receive, legs.transmit)
    turn = dot(across, across)
    te = dot(legs.received, across) * dot(legs.sent, across) / at_least(turn, LEAST_TURN)
    return Shares(te=te, tm=conductor_mirror(legs) + te)


def conductor_mirror(legs: Legs) -> Any:
    """Reflect links at the conducting mirror between their legs. [-]."""
    squared = at_least(1.0 + dot(legs.transmit, legs.receive), LEAST_TURN)  # half of |q|²
    product = dot(legs.receive, legs.sent) * dot(legs.transmit, legs.received)
    return product / squared - dot(legs.sent, legs.received)


def facet_coefficients(
    material: Material,
    transmit: Float[np.ndarray, "facets 3"],
    receive: Float[np.ndarray, "facets 3"],
    frequencies: Float[np.ndarray, " nodes"],
    *,
    fields: tuple[Float[np.ndarray, "facets 3"], Float[np.ndarray, "facets 3"]] | None,
    polarization: Polarization2D = "vertical",
) -> Float[np.ndarray, "1 facets"] | Complex[np.ndarray, "nodes facets"]:
    """Reflection coefficient of each facet at each frequency; one row if it does not vary.

    Parameters
    ----------
    material
        What the facets are made of.
    transmit, receive
        Unit vectors from the facets to the antennas.
    frequencies
        Any grid. [Hz]
    fields
        Vectors of the fields of both antennas there; None in two dimensions.
    polarization
        Of the antennas, in two dimensions: the electric field is along z, or the magnetic one.
    """
    if fields is None:
        if isinstance(material, Conductor):
            return np.full((1, len(transmit)), -1.0 if polarization == "vertical" else 1.0)
        both = over_angles(material, frequencies, half_angle_cosine(transmit, receive))
        return both.te if polarization == "vertical" else both.tm
    legs = Legs(transmit.T, receive.T, fields[0].T, fields[1].T)
    if isinstance(material, Conductor):
        return np.asarray(conductor_mirror(legs))[None]
    both = over_angles(material, frequencies, half_angle_cosine(transmit, receive))
    shares = mirror_shares(legs)
    return np.asarray(shares.te * both.te + shares.tm * both.tm)


def over_angles(
    material: Material, frequencies: Float[np.ndarray, " nodes"], cosines: Float[np.ndarray, " n"]
) -> Coefficients:
    """Reflection coefficients [nodes, n], interpolated between angles where those are many."""
    low, high = float(cosines.min()), float(cosines.max())
    for count in NODE_COUNTS:
        if 4 * count >= len(cosines):
            break
        angles = chebyshev_nodes(low, high, count)
        between = np.linspace(low, high, 2 * count + 1)
        sampled = reflection(material, frequencies, angles)
        exact = reflection(material, frequencies, between)
        basis = barycentric_basis(angles, between).T
        worst = max(
            float(np.abs(basis @ part - true).max())
            for part, true in zip(sampled, exact, strict=True)
        )
        if worst <= ACCURACY:
            basis = barycentric_basis(angles, cosines).T
            # Not by matrix product: its rounding depends on the number of threads.
            return Coefficients(*(np.einsum("cq,qm->mc", basis, part) for part in sampled))
    return Coefficients(*(part.T for part in reflection(material, frequencies, cosines)))


def echo_coefficient(
    material: Material,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    polarization: Polarization2D = "vertical",
) -> Complex[np.ndarray, " freqs"]:
    """Reflection coefficient for an echo to where it came from: at normal incidence. [-]."""
    both = reflection(material, frequencies, np.ones(1))
    coefficient: np.ndarray = (both.te if polarization == "vertical" else both.tm)[0]
    return coefficient


def reflection_nodes(
    material: Material,
    start: float,
    stop: float,
    *,
    lowest: float = STEEP,
    accuracy: float = ACCURACY,
) -> int:
    """Count the Chebyshev nodes over a band that interpolate a material's coefficients.

    They are tried out at all angles: a slab ripples with the delay of its inner echoes, the
    faster the thicker it is and the less it absorbs, and more sharply at grazing incidence.

    Parameters
    ----------
    material
        What reflects.
    start, stop
        The band. [Hz]
    lowest
        Cosine of the most grazing angle of incidence. [-]
    accuracy
        Largest error. [-]

    Returns
    -------
    The fewest whose error is below the accuracy; for angles more
    grazing than :data:`STEEP` no more than the last of :data:`NODE_COUNTS`, whatever the error.

    Raises
    ------
    MaterialError
        If a slab ripples too fast to be followed.
    """
    if isinstance(material, Conductor):
        return 1
    return node_count(
        lambda points, cosines: reflection(material, points, cosines),
        start,
        stop,
        lowest=lowest,
        accuracy=accuracy,
    )


def node_count(
    coefficients: Callable[[Float[np.ndarray, " freqs"], Float[np.ndarray, " n"]], Coefficients],
    start: float,
    stop: float,
    *,
    lowest: float = STEEP,
    accuracy: float = ACCURACY,
) -> int:
    """Count the Chebyshev nodes over a band that interpolate coefficients of a slab.

    Parameters
    ----------
    coefficients
        Of frequencies and cosines of incidence.
    start, stop, lowest, accuracy
        As for :func:`reflection_nodes`, which tells what is raised.
    """
    cosines = np.linspace(lowest, 1.0, 15)
    # Five points between two nodes; none of them is one.
    points = np.linspace(start, stop, 5 * NODE_COUNTS[-1] + 1)
    exact = np.concatenate(coefficients(points, cosines))
    worst = np.inf
    for count in NODE_COUNTS:
        nodes = chebyshev_nodes(start, stop, count)
        sampled = np.concatenate(coefficients(nodes, cosines))
        worst = float(np.abs(sampled @ barycentric_basis(nodes, points) - exact).max())
        if worst <= accuracy:
            return count
    if worst <= COARSEST or lowest < STEEP:
        return NODE_COUNTS[-1]
    raise MaterialError(
        f"the slab's coefficient ripples too fast over {start / 1e9:g}-{stop / 1e9:g} GHz to be "
        f"followed at {NODE_COUNTS[-1]} frequencies (error {worst:.1g}, the limit is "
        f"{COARSEST:g}); make it thinner or thickness_mm = inf (opaque), or narrow the band"
    )


def angle_class(cosines: Float[np.ndarray, " n"]) -> float:
    """Return the largest of a few cosines that none of these is below (or the smallest). [-]."""
    lowest = float(cosines.min(initial=1.0))
    return max((limit for limit in ANGLE_CLASSES if limit <= lowest), default=ANGLE_CLASSES[0])
