r"""Weighted curvature approximation of rough facets, beyond the tangent plane, both polarizations.

With unit vectors :math:`\hat u` from a facet to the two antennas, their fields' vectors
:math:`\hat e`, :math:`\mathbf q = \hat u_t + \hat u_r`, the mean surface's normal
:math:`\hat n` and the slope :math:`\nabla h` (so that :math:`\mathbf N = \hat n - \nabla h` is
along the facet's normal), the scattering kernels in units of the tangent plane's are

.. math:: K = \tfrac12 |\mathbf q|^2\, \Gamma(\hat e_t, \hat e_r)

.. math:: B = -\tfrac12 (\varepsilon - 1) (\mathbf E_t \cdot \mathbf E_r + D_t D_r / \varepsilon)

K is the tangent plane's at its stationary point, :math:`\Gamma` the Fresnel coefficients at half
the angle between the legs; B is first-order small perturbations' (Rice 1951), here as Hadamard's
variation of the link with the boundary: :math:`\mathbf E` is the total field along the mean
plane, D the total normal displacement, of a unit wave from either antenna. A conductor has
:math:`B = -2 [(\hat u_t \times \hat e_t)_\parallel \cdot (\hat u_r \times \hat e_r)_\parallel
+ (\hat n \cdot \hat e_t)(\hat n \cdot \hat e_r)]`. Their difference F = B - K, as a function of
:math:`\hat n`, vanishes to second order where :math:`\hat n` is along :math:`\mathbf q`. The
facet's tangent-plane weight :math:`\Gamma (\hat n_f \cdot \mathbf q)\, dA` then becomes that plus

.. math:: -2 \Bigl[F(\hat n) \frac{\mathbf q_\parallel \cdot \nabla h}{q_\parallel^2}
          + \frac{g}{q_z} F(\mathbf q / q_z + \nabla h) \Bigr]\, \hat n \cdot \hat n_f\, dA

the weighted curvature approximation [1]_, [2]_, in a form without effect on a flat surface: the
first term is B - K after an integration by parts, the second the curvature's. To first order in
the heights the sum is exactly B; a facet that specularly connects the antennas keeps its
tangent-plane weight.

For slopes much shorter than the wavelength the second term is too large [2]_; it agrees with full
wave if slopes are smoothed over a sixth of the wavelength. The share g is the part of the slopes'
variance left by this smoothing.

Written for arrays of NumPy and Dr.Jit alike; a vector is indexed by its axis first.

References
----------
.. [1] T. Elfouhaily, S. Guignard, D. R. Thompson, "Formal tilt invariance of the local curvature
   approximation", Waves in Random Media, 2003, 13(4), L7-L11.
.. [2] T. M. Elfouhaily, C.-A. Guérin, "A critical survey of approximate scattering wave theories
   from random rough surfaces", Waves in Random Media, 2004, 14(4), R1-R40.
"""

from typing import Any

import numpy as np

from simulator.materials.facet_reflection import Legs, conductor_mirror
from simulator.materials.fresnel_slab import Conductor, Dielectric, Material
from simulator.numerics.vectors import added, at_least, cross, dot, scaled, square_root

LEAST_LATERAL = 1e-8
"""Squared lateral component of q below which a link counts as specular: F is then below the
rounding of single precision. [-]"""

LEAST_NORMAL = 1e-3
"""Component of q along the normal below which both antennas are at grazing angles. [-]"""


class ConductorKernel:
    """B - K of a perfect conductor."""

    def __init__(self, legs: Legs) -> None:
        self._legs = legs
        self._currents = (
            cross(legs.transmit, legs.sent),
            cross(legs.receive, legs.received),
        )
        same = legs.transmit is legs.receive and legs.sent is legs.received
        self._constant: Any = 0.0
        if not same:
            self._constant = (1.0 - dot(legs.transmit, legs.receive)) * dot(
                legs.sent, legs.received
            ) + dot(legs.transmit, legs.received) * dot(legs.receive, legs.sent)

    def __call__(self, normal: Any) -> Any:
        """Evaluate at a unit normal of the mean surface. [-]."""
        one, other = (dot(current, normal) for current in self._currents)
        fields = dot(self._legs.sent, normal) * dot(self._legs.received, normal)
        return self._constant + 2.0 * (one * other - fields)


class DielectricKernel:
    """B - K of the rough boundary of a dielectric half space."""

    def __init__(self, legs: Legs, permittivity: Any) -> None:
        self._legs, self._permittivity = legs, permittivity
        half = 0.5 * (1.0 + dot(legs.transmit, legs.receive))  # squared cosine of half the angle
        half = at_least(half, 1e-6)
        cosine = square_root(half)
        inner = square_root(permittivity - 1.0 + half)
        electric, magnetic = cosine + inner, permittivity * cosine + inner
        across = cross(legs.receive, legs.transmit)
        # (R_TE + R_TM) times the share of TE, without their common 0/0 in the monostatic case.
        both = -0.5 * (permittivity - 1.0) / (electric * magnetic)
        both = both * (dot(legs.received, across) * dot(legs.sent, across) / half)
        magnetic_mirror = (permittivity * cosine - inner) / magnetic
        self._tangent = 2.0 * half * (magnetic_mirror * conductor_mirror(legs) + both)

    def __call__(self, normal: Any) -> Any:
        """Evaluate at a unit normal of the mean surface. [-]."""
        legs, permittivity = self._legs, self._permittivity
        here, there = dot(legs.transmit, normal), dot(legs.receive, normal)
        sent, received = dot(legs.sent, normal), dot(legs.received, normal)
        one = self._boundary(here)
        other = one if legs.transmit is legs.receive else self._boundary(there)
        along = dot(legs.sent, legs.received) - sent * received
        # Components along the mean plane of the fields within the planes of incidence.
        first = dot(legs.sent, legs.receive) - sent * there
        second = dot(legs.received, legs.transmit) - received * here
        both = dot(legs.transmit, legs.receive) - here * there
        fields = one[0] * other[0] * along
        fields = fields + one[0] * other[1] * (received * first)
        fields = fields + one[1] * other[0] * (sent * second)
        fields = fields + one[1] * other[1] * (sent * received * both)
        fields = fields + one[2] * other[2] * (sent * received) / permittivity
        return -0.5 * (permittivity - 1.0) * fields - self._tangent

    def _boundary(self, cosine: Any) -> tuple[Any, Any, Any]:
        """Factors of e and (e·n) u for the total field along the boundary, of e·n across it."""
        permittivity = self._permittivity
        cosine = at_least(cosine, 0.0)
        inner = square_root(permittivity - 1.0 + cosine * cosine)
        electric, magnetic = cosine + inner, permittivity * cosine + inner
        twice = 2.0 * cosine
        crossed = -twice * (permittivity - 1.0) / (electric * magnetic)
        return twice / electric, crossed, twice * permittivity / magnetic


def scattering_kernel(
    material: Material, legs: Legs, permittivity: Any
) -> ConductorKernel | DielectricKernel:
    """Return B - K of a material; a conductor needs no permittivity."""
    if isinstance(material, Conductor):
        return ConductorKernel(legs)
    return DielectricKernel(legs, permittivity)


def middle_permittivity(material: Material, start: float, stop: float) -> complex:
    """Relative permittivity in the middle of a band [Hz]; it varies little over one. [-]."""
    if not isinstance(material, Dielectric):
        return 1.0 + 0j
    return complex(material.permittivity(np.array([0.5 * (start + stop)]))[0])


def half_space_mirror(permittivity: complex) -> complex:
    """Coefficient of a half space at normal incidence. [-]."""
    index = complex(np.sqrt(permittivity + 0j))
    return (1.0 - index) / (1.0 + index)


def curvature_weight(
    kernel: ConductorKernel | DielectricKernel,
    legs: Legs,
    mean: Any,
    slope: Any,
    share: float,
) -> Any:
    """Return the term added to a facet's tangent-plane weight, per mean area. [-].

    Parameters
    ----------
    kernel
        B - K of its material, between these legs.
    legs
        To both antennas.
    mean
        Normal of the mean surface, on the antennas' side.
    slope
        Gradient of the heights, along the mean surface. [-]
    share
        Of the slopes' variance left by smoothing, see :func:`slope_share`. [-]
    """
    both = added(legs.transmit, legs.receive)
    normal = at_least(dot(both, mean), LEAST_NORMAL)
    lateral = added(both, mean, -normal)
    squared = at_least(dot(lateral, lateral), LEAST_LATERAL)
    weight = kernel(mean) * (dot(lateral, slope) / squared)
    if share > 0.0:
        away = added(scaled(both, 1.0 / normal), slope)
        unit = scaled(away, 1.0 / square_root(dot(away, away)))
        weight = weight + kernel(unit) * (share / normal)
    return -2.0 * weight
