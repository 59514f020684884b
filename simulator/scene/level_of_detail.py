"""Which smooth flat bodies of a scene in space are mirrors only, and need no facets."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from scenes.checks.facet_budget import facet_counts
from scenes.realisations.object_surface import Surface
from scenes.scenario import Scenario
from scenes.surfaces.level_of_detail import flat_and_smooth
from scenes.surfaces.tiled_faces import Reach
from simulator.geometry.mean_surfaces import mean_surfaces
from simulator.materials.fresnel_slab import Absorber, Material
from simulator.scene.array_antennas import in_space, needed_reach

MOST_SMOOTH = 2**21
"""Most facets of all smooth flat bodies together, where antennas reach: about a minute of two
cores for an array of eight elements. What is beyond, the largest first, is a mirror. [-]"""

SAMPLES = 4096
"""Places on a body by which the share of it is estimated that antennas reach: to 1 %. [-]"""


def mirrored_bodies(
    scenario: Scenario,
    materials: Mapping[str, Material],
    elements: Float[np.ndarray, "elements 3"],
) -> frozenset[str]:
    """Choose the bodies whose reflection is that of images, and no sum over facets.

    The smallest bodies keep their facets, up to :data:`MOST_SMOOTH` of them; facets also give
    what edges scatter, and the ghosts of a body seen over walls.

    Parameters
    ----------
    scenario, materials
        What there is.
    elements
        Where the array's antennas truly stand. [m]

    Returns
    -------
    Their names; none in two dimensions, where facets are few, and none where antennas stand by
    themselves.
    """
    if not in_space(scenario):
        return frozenset()
    longest = scenario.radio.longest_wavelength
    flat = {
        name: body
        for name, body in scenario.objects.items()
        if not isinstance(materials[name], Absorber) and flat_and_smooth(body, longest)
    }
    if not flat:
        return frozenset()
    whole = facet_counts(flat, scenario.radio.shortest_wavelength)
    if sum(whole.values()) <= MOST_SMOOTH:
        return frozenset()
    reach = needed_reach(scenario, elements, ())
    smooth = {surface.name: surface for surface in mean_surfaces(scenario)}
    counts = {name: whole[name] * _share(smooth[name], reach) for name in flat}
    order = sorted(counts, key=lambda name: counts[name])
    together = np.cumsum([counts[name] for name in order])
    return frozenset(name for name, sum_ in zip(order, together, strict=True) if sum_ > MOST_SMOOTH)


def _share(surface: Surface, reach: Reach) -> float:
    """Return the share of a surface that antennas reach, from places spread evenly over it. [-]."""
    corners = surface.vertices[surface.cells]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1
    )
    areas = areas / 2
    ends = np.cumsum(areas)
    at = (np.arange(SAMPLES) + 0.5) / SAMPLES * ends[-1]
    cell = np.minimum(np.searchsorted(ends, at), len(areas) - 1)
    # Two more fractions of the golden ratio's kind fill each triangle evenly.
    first, second = np.modf(np.outer([0.7548776662466927, 0.5698402909980532], np.arange(SAMPLES)))[
        0
    ]
    over = first + second > 1
    first, second = np.where(over, 1 - first, first), np.where(over, 1 - second, second)
    some = corners[cell]
    places = (
        some[:, 0]
        + first[:, None] * (some[:, 1] - some[:, 0])
        + second[:, None] * (some[:, 2] - some[:, 0])
    )
    return float(reach(places, float(np.sqrt(ends[-1] / SAMPLES))).mean())
