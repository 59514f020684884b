r"""What slabs of a dielectric do to a wave between two points: loss, phase, delay and bending.

Between points a distance :math:`L` apart a wave is a spectrum of plane waves, each of which a slab
of thickness :math:`d` multiplies by :math:`T(\theta)\,e^{jkd\cos\theta}`: its coefficient of
transmission (Airy's sum, ITU-R P.2040-4), over the air that it takes the place of. The optical path
that it adds, :math:`P(\theta) = d\,(\sqrt{n^2 - \sin^2\theta} - \cos\theta)`, moves the point of
stationary phase off the straight line,

.. math:: \theta^* = \theta + s / L, \qquad s = P'(\theta) =
          d \sin\theta \left(1 - \frac{\cos\theta}{\sqrt{n^2 - \sin^2\theta}}\right)

with the sideways shift :math:`s` of a ray through the slab (Snell). At that angle the slab's factor
is taken, the bent ray gains a phase of :math:`kL (1 - \cos(\theta^* - \theta))`, and the wave
front, curved as from a nearer source, is stronger by

.. math:: \left[(1 - P''/L)(1 - P'/(L \tan\theta))\right]^{-1/2}.

What is left out is of the order :math:`(d/L)^2`, and for the waves that run to and fro within the
slab their further shift: a phase of :math:`k(2s)^2/2L` for those that do so once. Several slabs
add their shifts, as vectors, and multiply their factors.

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

from simulator.materials.facet_reflection import STEEP, node_count
from simulator.materials.fresnel_slab import Coefficients, Dielectric, transmission

CLOSEST = 0.25
"""Least share of the distance to the apparent source in the true one: antennas nearer to a slab
than its thickness are no rays' matter any more. [-]"""

LEAST_LEVEL = 1e-3
"""Product of the slabs' transmission that is left out: -60 dB of free space. [-]"""


PARALLEL = 1e-9
"""Sine of the angle of incidence below which it is 0: what is left across is rounding. [-]"""


class Crossing(NamedTuple):
    """A slab in the way."""

    material: Dielectric
    normal: Float[np.ndarray, " 3"]  # unit vector, to either side


class Bent(NamedTuple):
    """Rays through slabs, over the straight lines between their ends."""

    directions: Float[np.ndarray, "rays 3"]  # outside of the slabs, unit vectors
    saved: Float[np.ndarray, " rays"]  # optical path in the air less than the straight line's [m]
    within: Float[np.ndarray, " rays"]  # gain of the field by curvature in the plane of incidence
    across: Float[np.ndarray, " rays"]  # and across it [-]


def inserted(
    material: Dielectric, frequencies: Float[np.ndarray, " freqs"], cosines: Float[np.ndarray, "*n"]
) -> Coefficients:
    """Coefficients of transmission over those of the air in the slab's place. [-].

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
    """Bend rays as slabs between their ends do.

    Parameters
    ----------
    crossings
        The slabs.
    directions, lengths
        Of the straight lines; unit vectors, and [m].
    frequency
        Whose refractive index is taken. [Hz]
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
    """Take a vector field through slabs, in three dimensions.

    Parameters
    ----------
    crossings, directions, lengths
        As for :func:`bent_rays`.
    frequencies
        Any grid. [Hz]
    field
        What would be there without them.
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
    """Return the field behind slabs along that without them, over it, in three dimensions. [-].

    What a slab turns out of the field's direction is left out.

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
    """Return unit vectors across the plane of incidence; none at normal incidence: TE is TM."""
    across = np.cross(directions, normal)
    size = np.sqrt(np.einsum("rx,rx->r", across, across))[:, None]
    return np.asarray(np.divide(across, size, out=np.zeros_like(across), where=size > PARALLEL))


def _in_turn(
    crossings: Sequence[Crossing], bent: Bent, frequencies: Float[np.ndarray, " freqs"]
) -> Iterator[tuple[Coefficients, Float[np.ndarray, " 3"]]]:
    """Yield what each slab inserts into bent rays [rays, freqs], and its normal."""
    for material, normal in crossings:
        cosines = np.abs(np.einsum("rx,x->r", bent.directions, normal))
        yield inserted(material, frequencies, cosines), normal


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
    """Bound what slabs let through, over the band and all angles. [-].

    Angles up to 84° are tried; beyond, waves are reflected.
    """
    some = frequencies[:: max(1, frequencies.size // 32)]
    cosines = np.linspace(STEEP, 1.0, 19)
    level = 1.0
    for material, _ in crossings:
        both = transmission(material, some, cosines)
        level *= float(max(np.abs(both.te).max(), np.abs(both.tm).max()))
    return level


def passage_nodes(crossings: Sequence[Crossing], start: float, stop: float) -> int:
    """Count the Chebyshev nodes over a band that interpolate what slabs insert.

    Parameters
    ----------
    crossings
        The slabs.
    start, stop
        The band. [Hz]

    Raises
    ------
    MaterialError
        If one ripples too fast to be followed.
    """
    counts = [node_count(partial(inserted, one.material), start, stop) for one in crossings]
    return 1 + sum(count - 1 for count in counts)
