r"""Effect of dielectric slabs on a wave between two points: loss, phase, delay and refraction.

Between points a distance :math:`L` apart a wave is a spectrum of plane waves, each of which a slab
of thickness :math:`d` multiplies by :math:`T(\theta)\,e^{jkd\cos\theta}`: its coefficient of
transmission (Airy's sum, ITU-R P.2040-4), over that of the air in its place. The optical path
that it adds, :math:`P(\theta) = d\,(\sqrt{n^2 - \sin^2\theta} - \cos\theta)`, moves the point of
stationary phase off the straight line,

.. math:: \theta^* = \theta + s / L, \qquad s = P'(\theta) =
          d \sin\theta \left(1 - \frac{\cos\theta}{\sqrt{n^2 - \sin^2\theta}}\right)

with the lateral shift :math:`s` of a ray through the slab (Snell). The slab's factor is taken at
that angle, the refracted ray gains a phase of :math:`kL (1 - \cos(\theta^* - \theta))`, and the
wavefront, curved as from a nearer source, is stronger by

.. math:: \left[(1 - P''/L)(1 - P'/(L \tan\theta))\right]^{-1/2}.

Left out are terms of the order :math:`(d/L)^2`, and the further lateral shift of waves reflected
within the slab: a phase of :math:`k(2s)^2/2L` after one internal round trip. The shifts of several
slabs add as vectors, and their factors multiply.

References
----------
.. [1] M. Born and E. Wolf, "Principles of Optics", 7th ed., 1999, 1.6.4 and 7.6.1.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from simulator.materials.facet_reflection import STEEP, node_count, over_angles
from simulator.materials.fresnel_slab import Coefficients, Dielectric, transmission

CLOSEST = 0.25
"""Least ratio of the distance to the apparent source to the true distance: for antennas nearer to a
slab than about its thickness the ray approximation fails. [-]"""

LEAST_LEVEL = 1e-3
"""Product of the slabs' transmission below which a path is left out: -60 dB of free space. [-]"""


PARALLEL = 1e-9
"""Sine of the angle of incidence below which incidence counts as normal: less is rounding. [-]"""


class Crossing(NamedTuple):
    """A slab crossed by a ray."""

    material: Dielectric
    normal: Float[np.ndarray, " 3"]  # unit vector, to either side


class Bent(NamedTuple):
    """Refracted rays through slabs, relative to the straight lines between their ends."""

    directions: Float[np.ndarray, "rays 3"]  # outside of the slabs, unit vectors
    saved: Float[np.ndarray, " rays"]  # straight line's optical path less the ray's in air [m]
    within: Float[np.ndarray, " rays"]  # gain of the field by curvature in the plane of incidence
    across: Float[np.ndarray, " rays"]  # and across it [-]


def inserted(
    material: Dielectric, frequencies: Float[np.ndarray, " freqs"], cosines: Float[np.ndarray, "*n"]
) -> Coefficients:
    """Coefficients of transmission over those of air in the slab's place. [-].

    Parameters
    ----------
    material
        The slab.
    frequencies
        Any grid. [Hz]
    cosines
        Of the angles of incidence. [-]
    """
    air = np.exp(
        2j * np.pi / speed_of_light * material.thickness * cosines[..., None] * frequencies
    )
    through = transmission(material, frequencies, cosines)
    return Coefficients(through.te * air, through.tm * air)


def bent_rays(
    crossings: Sequence[Crossing],
    directions: Float[np.ndarray, "rays 3"],
    lengths: Float[np.ndarray, " rays"],
    frequency: float,
) -> Bent:
    """Refract rays at slabs between their ends.

    Parameters
    ----------
    crossings
        The slabs.
    directions, lengths
        Of the straight lines; unit vectors, and [m].
    frequency
        At which the refractive index is taken. [Hz]
    """
    tilt = np.zeros_like(directions)
    within, across = np.ones(len(directions)), np.ones(len(directions))
    for material, normal in crossings:
        index = np.sqrt(material.permittivity(np.array([frequency])))[0].real
        upright = np.einsum("rx,x->r", directions, normal)
        cosine = np.minimum(np.abs(upright), 1.0)
        inner = np.sqrt(index**2 - 1.0 + cosine**2)
        slip = material.thickness * (1.0 - cosine / inner)
        away = cosine[:, None] * directions - np.sign(upright)[:, None] * normal
        tilt += (slip / lengths)[:, None] * away
        flat = slip * cosine
        steep = material.thickness * (1.0 - cosine**2) * (index**2 - 1.0) / inner**3
        within *= np.maximum(1.0 - (flat + steep) / lengths, CLOSEST)
        across *= np.maximum(1.0 - flat / lengths, CLOSEST)
    bent = directions + tilt
    stretch = np.sqrt(np.einsum("rx,rx->r", bent, bent))
    return Bent(
        directions=bent / stretch[:, None],
        saved=lengths * (1.0 - 1.0 / stretch),
        within=1.0 / np.sqrt(within),
        across=1.0 / np.sqrt(across),
    )


def through_slabs(
    crossings: Sequence[Crossing],
    directions: Float[np.ndarray, "rays 3"],
    lengths: Float[np.ndarray, " rays"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    vertical: bool,
    cylindrical: bool,
) -> Complex[np.ndarray, "rays freqs"]:
    """Field behind slabs over that without them, in two dimensions. [-].

    Parameters
    ----------
    crossings, directions, lengths
        As for :func:`bent_rays`.
    frequencies
        Any grid. [Hz]
    vertical
        Whether the electric field is along z; else the magnetic one is.
    cylindrical
        Whether the wave spreads in the plane only.
    """
    bent, total = _common(crossings, directions, lengths, frequencies, cylindrical=cylindrical)
    for both, _ in _in_turn(crossings, bent, frequencies):
        total *= both.te if vertical else both.tm
    return total


def transported_through(
    crossings: Sequence[Crossing],
    directions: Float[np.ndarray, "rays 3"],
    lengths: Float[np.ndarray, " rays"],
    frequencies: Float[np.ndarray, " freqs"],
    field: Complex[np.ndarray, "rays freqs 3"],
) -> Complex[np.ndarray, "rays freqs 3"]:
    """Transmit a vector field through slabs, in three dimensions.

    Parameters
    ----------
    crossings, directions, lengths
        As for :func:`bent_rays`.
    frequencies
        Any grid. [Hz]
    field
        The field without the slabs.
    """
    bent, common = _common(crossings, directions, lengths, frequencies, cylindrical=False)
    for both, normal in _in_turn(crossings, bent, frequencies):
        across = across_plane(directions, normal)
        part = (both.te - both.tm) * np.einsum("rfx,rx->rf", field, across)
        field = both.tm[..., None] * field + part[..., None] * across[:, None]
    return np.asarray(common[..., None] * field)


def along_field(
    crossings: Sequence[Crossing],
    directions: Float[np.ndarray, "rays 3"],
    lengths: Float[np.ndarray, " rays"],
    frequencies: Float[np.ndarray, " freqs"],
    field: Float[np.ndarray, "rays 3"],
) -> Complex[np.ndarray, "rays freqs"]:
    """Return the co-polar transmission of slabs in three dimensions. [-].

    The component of the field behind the slabs along the field without them, over the latter's
    amplitude; the cross-polar component is left out.

    Parameters
    ----------
    crossings, directions, lengths
        As for :func:`bent_rays`.
    frequencies
        Any grid. [Hz]
    field
        Unit vectors across the rays.
    """
    bent, total = _common(crossings, directions, lengths, frequencies, cylindrical=False)
    for both, normal in _in_turn(crossings, bent, frequencies):
        share = np.einsum("rx,rx->r", field, across_plane(directions, normal))[:, None] ** 2
        total *= both.tm + (both.te - both.tm) * share
    return total


def across_plane(
    directions: Float[np.ndarray, "rays 3"], normal: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "rays 3"]:
    """Return unit vectors across the plane of incidence; 0 at normal incidence, where TE is TM."""
    across = np.cross(directions, normal)
    size = np.sqrt(np.einsum("rx,rx->r", across, across))[:, None]
    return np.asarray(np.divide(across, size, out=np.zeros_like(across), where=size > PARALLEL))


def _in_turn(
    crossings: Sequence[Crossing], bent: Bent, frequencies: Float[np.ndarray, " freqs"]
) -> Iterator[tuple[Coefficients, Float[np.ndarray, " 3"]]]:
    """Yield each slab's transmission of the refracted rays [rays, freqs], and its normal."""
    for material, normal in crossings:
        cosines = np.abs(np.einsum("rx,x->r", bent.directions, normal))
        both = over_angles(partial(inserted, material), frequencies, cosines)
        yield Coefficients(both.te.T, both.tm.T), normal


def _common(
    crossings: Sequence[Crossing],
    directions: Float[np.ndarray, "rays 3"],
    lengths: Float[np.ndarray, " rays"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    cylindrical: bool,
) -> tuple[Bent, Complex[np.ndarray, "rays freqs"]]:
    middle = float(frequencies[frequencies.size // 2])
    bent = bent_rays(crossings, directions, lengths, middle)
    gain = bent.within if cylindrical else bent.within * bent.across
    turns = bent.saved[:, None] * (frequencies / speed_of_light)
    return bent, gain[:, None] * np.exp(2j * np.pi * turns)


def passage_level(crossings: Sequence[Crossing], frequencies: Float[np.ndarray, " freqs"]) -> float:
    """Return the largest transmission of slabs over the band and all angles up to 84°. [-].

    At more grazing incidence most of the wave is reflected.
    """
    some = frequencies[:: max(1, frequencies.size // 32)]
    cosines = np.linspace(STEEP, 1.0, 19)
    level = 1.0
    for material, _ in crossings:
        both = transmission(material, some, cosines)
        level *= float(max(np.abs(both.te).max(), np.abs(both.tm).max()))
    return level


def passage_nodes(crossings: Sequence[Crossing], start: float, stop: float) -> int:
    """Count the Chebyshev nodes over a band that interpolate the slabs' transmission.

    Parameters
    ----------
    crossings
        The slabs.
    start, stop
        The band. [Hz]

    Raises
    ------
    MaterialError
        If a slab's transmission ripples too fast over frequency to be interpolated.
    """
    counts = [node_count(partial(inserted, one.material), start, stop) for one in crossings]
    return 1 + sum(count - 1 for count in counts)
