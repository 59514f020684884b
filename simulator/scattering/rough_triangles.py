"""Weighted curvature of rough triangles, in NumPy."""

import numpy as np
from jaxtyping import Complex, Float

from simulator.geometry.facets import Facets
from simulator.materials.facet_reflection import Legs
from simulator.materials.fresnel_slab import Material
from simulator.numerics.vectors import added, dot
from simulator.scattering.weighted_curvature_3d import curvature_weight, scattering_kernel


def rough_weights(
    facets: Facets,
    side: Float[np.ndarray, " facets"],
    legs: Legs,
    material: Material,
    permittivity: complex,
    share: float,
) -> Float[np.ndarray, " facets"] | Complex[np.ndarray, " facets"]:
    """Return the curvature term added to obliquity times reflection, per area of the facets. [-].

    Parameters
    ----------
    facets
        Triangles that are rough.
    side
        1 if the antennas are on the normals' side, -1 on the other. [-]
    legs
        To both antennas.
    material, permittivity
        Of the facets.
    share
        See :class:`simulator.geometry.facets.Relief`.
    """
    if facets.relief is None:
        raise ValueError("smooth facets have no curvature weight; give facets with a relief")
    mean = np.multiply(facets.relief.normals.T, side, dtype=np.float64)
    normals = facets.normals.T * side
    upright = dot(mean, normals)
    slope = added(mean, normals, -1.0 / upright)
    kernel = scattering_kernel(material, legs, permittivity)
    return np.asarray(upright * curvature_weight(kernel, legs, mean, slope, share))
