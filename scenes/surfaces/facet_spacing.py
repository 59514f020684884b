"""How finely a surface must be cut into facets, and how many facets that makes."""

import math

from scenes.schema.objects import Body, Box, Cylinder, Plate

FACETS_PER_WAVELENGTH = 4
"""Facets per shortest wavelength: the phase turns by at most π over one, there and back [-]."""

FACETS_PER_CORRELATION_LENGTH = 4
"""Facets per correlation length: resolves a Gaussian spectrum to 1e-12 of its peak [-]."""

FACETS_PER_CUTOFF = 2
"""Facets per inner cut-off: what an exponential spectrum has beyond is below e^(-π²) [-]."""

BYTES_PER_FACET = 128
"""What a facet takes: two vertices or their share, centre, normal, size, field [byte]."""

MOST_BYTES = 16 * 2**30
"""What the facets of a scenario may take in all [byte]."""

FEWEST_ROUND = 64
"""Fewest lines around a cylinder, however coarse the spacing: 6° each [-]."""


def facet_spacing(body: Body, shortest_wavelength: float) -> float:
    """Return the largest spacing of vertices at which facet sums of physical optics converge [m].

    It is min(λ/4, l/4), with half the inner cut-off as a third limit for an exponential
    spectrum. An absorber scatters nothing and needs no facets: infinity.

    Parameters
    ----------
    body
        The object.
    shortest_wavelength
        At the highest frequency of the radio. [m]
    """
    if body.material == "absorber":
        return math.inf
    spacing = shortest_wavelength / FACETS_PER_WAVELENGTH
    rough = body.roughness
    if rough is not None and rough.rms > 0:
        for scale in rough.scales:
            if scale.rms_mm == 0:
                continue
            spacing = min(spacing, scale.correlation_length / FACETS_PER_CORRELATION_LENGTH)
            if scale.inner_cutoff > 0:
                spacing = min(spacing, scale.inner_cutoff / FACETS_PER_CUTOFF)
    return spacing


def steps(length: float, spacing: float) -> int:
    """Count the equal steps of at most ``spacing`` in ``length``; at least one."""
    # A length that is a whole number of steps must not gain one by rounding.
    return max(1, math.ceil(length / spacing * (1 - 1e-12)))


def steps_round(radius: float, spacing: float) -> int:
    """Count the equal steps of at most ``spacing`` around a circle."""
    return max(FEWEST_ROUND, steps(2 * math.pi * radius, spacing))


def facet_count(body: Plate | Cylinder | Box, spacing: float) -> int:
    """Count the facets of a surface: lines in 2-D (no height), triangles in 3-D."""
    height = body.height_m
    match body:
        case Plate():
            along = steps(body.length_m, spacing)
            return along if height is None else 2 * along * steps(height, spacing)
        case Cylinder():
            around = steps_round(body.radius_m, spacing)
            if height is None:
                return around
            rings = steps(body.radius_m, spacing)
            side = 2 * around * steps(height, spacing)
            return side + 2 * around * (2 * rings - 1)
        case Box():
            along, across = steps(body.length_m, spacing), steps(body.depth_m, spacing)
            if height is None:
                return 2 * (along + across)
            up = steps(height, spacing)
            return 4 * (along * across + across * up + up * along)


def mesh_facet_count(area: float, faces: int, spacing: float) -> int:
    """Estimate the triangles of a mesh of that area with edges no longer than ``spacing``.

    Cutting edges in half until they are short enough leaves triangles of a half to a quarter
    of the largest area; the estimate takes the smaller.
    """
    return faces + math.ceil(4 * area / spacing**2)
