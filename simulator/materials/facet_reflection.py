r"""Reflection of facets: Fresnel coefficients at half the bistatic angle, polarized antennas.

A facet reflects like the mirror that would specularly connect its two antennas: the angle of
incidence is half the angle between the legs, :math:`\cos\vartheta = |\hat u_t + \hat u_r| / 2`
with unit vectors from the facet to the antennas. In the specular direction this is the true
angle of incidence; elsewhere it is symmetric in both legs, so that the link stays reciprocal. A
monostatic echo is thus reflected as at normal incidence.

In two dimensions the electric field is along z, perpendicular to the plane of incidence (TE), or
the magnetic field is (TM). In three, the antennas' fields :math:`\hat e` are decomposed at that
mirror,

.. math:: \Gamma = (\hat e_r \cdot \hat s)(\hat s \cdot \hat e_t)\, \Gamma_{TE}
                 + (\hat e_r \cdot \hat p_r)(\hat p_t \cdot \hat e_t)\, \Gamma_{TM}

with :math:`\hat s` perpendicular to both legs and :math:`\hat p = \hat k \times \hat s`. For a
conductor :math:`\Gamma` is the difference of the two shares, :math:`2 (\hat m \cdot \hat e_t)
(\hat m \cdot \hat e_r) - \hat e_t \cdot \hat e_r` with the mirror's normal :math:`\hat m`: this is
continuous also in the monostatic case, where :math:`\hat s` is undefined.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from scenes.schema.radio import Polarization as Polarization2D
from simulator.materials.fresnel_slab import Coefficients, Conductor, Material, reflection
from simulator.materials.permittivity import MaterialError
from simulator.numerics.nufft_sum import ACCURACY, barycentric_basis, chebyshev_nodes
from simulator.numerics.vectors import Vector, at_least, cross, dot

NODE_COUNTS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 96, 128, 160, 192)
"""Allowed numbers of sampling frequencies of a coefficient; the smallest sufficient one is used."""

COARSEST = 1e-4
"""Error accepted at the largest number of nodes: interpolation of tabulated permittivity, which
has kinks, converges slowly. [-]"""

STEEP = 0.1
"""Smallest cosine of incidence at which a slab's ripple must be interpolated exactly: 84°. [-]"""

ANGLE_CLASSES = (0.02, 0.05, STEEP, 0.2, 0.35, 0.5, 0.7, 0.85)
"""Lower bounds of the classes of cosines into which links are sorted; each class has its own number
of nodes. [-]"""

LEAST_TURN = 1e-12
"""Squared sine between the legs below which they count as equal: TE and TM then agree. [-]"""


SlabCoefficients = Callable[[Float[np.ndarray, " freqs"], Float[np.ndarray, " n"]], Coefficients]
"""Coefficients [n, freqs] of a slab, of frequencies [Hz] and cosines of incidence [-]."""


class Legs(NamedTuple):
    """Unit vectors from facets to both antennas, and the antennas' field vectors, by axis."""

    transmit: Vector
    receive: Vector
    sent: Vector
    received: Vector


class Shares(NamedTuple):
    """Signed weights of the TE and TM coefficients in a link."""

    te: Any
    tm: Any


def half_angle_cosine(
    transmit: Float[np.ndarray, "facets 3"], receive: Float[np.ndarray, "facets 3"]
) -> Float[np.ndarray, " facets"]:
    """Cosine of half the angle between the directions to both antennas. [-]."""
    both = transmit + receive
    return np.asarray(np.minimum(0.5 * np.sqrt(np.einsum("fx,fx->f", both, both)), 1.0))


def mirror_shares(legs: Legs) -> Shares:
    """Decompose links into TE and TM at the mirror that connects their legs. [-].

    For arrays of NumPy and Dr.Jit alike.
    """
    across = cross(legs.receive, legs.transmit)
    turn = dot(across, across)
    te = dot(legs.received, across) * dot(legs.sent, across) / at_least(turn, LEAST_TURN)
    return Shares(te=te, tm=conductor_mirror(legs) + te)


def conductor_mirror(legs: Legs) -> Any:
    """Return the reflection of links by the conducting mirror that connects their legs. [-]."""
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
        Of the facets.
    transmit, receive
        Unit vectors from the facets to the antennas.
    frequencies
        Any grid. [Hz]
    fields
        Field vectors of both antennas at the facets; None in two dimensions.
    polarization
        Of the antennas, in two dimensions. Vertical: the electric field is along z; horizontal:
        the magnetic field is.
    """
    if fields is None:
        if isinstance(material, Conductor):
            return np.full((1, len(transmit)), -1.0 if polarization == "vertical" else 1.0)
        both = over_angles(
            partial(reflection, material), frequencies, half_angle_cosine(transmit, receive)
        )
        return both.te if polarization == "vertical" else both.tm
    legs = Legs(transmit.T, receive.T, fields[0].T, fields[1].T)
    if isinstance(material, Conductor):
        return np.asarray(conductor_mirror(legs))[None]
    both = over_angles(
        partial(reflection, material), frequencies, half_angle_cosine(transmit, receive)
    )
    shares = mirror_shares(legs)
    return np.asarray(shares.te * both.te + shares.tm * both.tm)


def over_angles(
    coefficients: SlabCoefficients,
    frequencies: Float[np.ndarray, " nodes"],
    cosines: Float[np.ndarray, " n"],
) -> Coefficients:
    """Coefficients of a slab [nodes, n], interpolated over angle if n is large.

    Parameters
    ----------
    coefficients
        Of frequencies and cosines of incidence.
    frequencies
        Any grid. [Hz]
    cosines
        Of the angles of incidence. [-]
    """
    low, high = float(cosines.min(initial=1.0)), float(cosines.max(initial=0.0))
    for count in NODE_COUNTS:
        if 4 * count >= len(cosines):
            break
        angles = chebyshev_nodes(low, high, count)
        between = np.linspace(low, high, 2 * count + 1)
        sampled = coefficients(frequencies, angles)
        exact = coefficients(frequencies, between)
        basis = barycentric_basis(angles, between).T
        worst = max(
            float(np.abs(basis @ part - true).max())
            for part, true in zip(sampled, exact, strict=True)
        )
        if worst <= ACCURACY:
            basis = barycentric_basis(angles, cosines)
            return Coefficients(*(_interpolated(part, basis) for part in sampled))
    return Coefficients(*(part.T for part in coefficients(frequencies, cosines)))


def _interpolated(
    sampled: Complex[np.ndarray, "angles nodes"], basis: Float[np.ndarray, "angles n"]
) -> Complex[np.ndarray, "nodes n"]:
    # Not by matrix product: its rounding depends on the number of threads. Real and imaginary
    # parts apart are five times as fast as a complex array by a real one.
    values = np.empty((sampled.shape[1], basis.shape[1]), dtype=np.complex128)
    values.real = np.einsum("qm,qc->mc", sampled.real, basis)
    values.imag = np.einsum("qm,qc->mc", sampled.imag, basis)
    return values


def echo_coefficient(
    material: Material,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    polarization: Polarization2D = "vertical",
) -> Complex[np.ndarray, " freqs"]:
    """Reflection coefficient of a monostatic echo: that at normal incidence. [-]."""
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

    The interpolation error is tested at all angles: a slab's coefficient ripples over frequency
    with the delay of its internal reflections, faster for thicker slabs and lower loss, and more
    sharply at grazing incidence.

    Parameters
    ----------
    material
        Of the surface.
    start, stop
        The band. [Hz]
    lowest
        Cosine of the most grazing angle of incidence. [-]
    accuracy
        Largest error. [-]

    Returns
    -------
    The smallest number whose error is below the accuracy; for angles more grazing than
    :data:`STEEP` at most the last of :data:`NODE_COUNTS`, whatever the error.

    Raises
    ------
    MaterialError
        If a slab's coefficient ripples too fast over frequency to be interpolated.
    """
    if isinstance(material, Conductor):
        return 1
    return node_count(
        partial(reflection, material),
        start,
        stop,
        lowest=lowest,
        accuracy=accuracy,
    )


def node_count(
    coefficients: SlabCoefficients,
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
        As a function of frequencies and cosines of incidence.
    start, stop, lowest, accuracy
        As for :func:`reflection_nodes`; so are the errors raised.
    """
    cosines = np.linspace(lowest, 1.0, 15)
    # Test points: five between neighbouring nodes, none at a node.
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
    """Return the largest of :data:`ANGLE_CLASSES` below all these cosines, or its smallest. [-]."""
    lowest = float(cosines.min(initial=1.0))
    return max((limit for limit in ANGLE_CLASSES if limit <= lowest), default=ANGLE_CLASSES[0])
