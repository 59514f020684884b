"""Triangles in small patches, whose sums vary slowly over the band and the array.

Relative to the delay of its centre, the sum over a patch's triangles is a smooth function of
frequency and of the antennas' positions, and is interpolated from a few of each. Within a patch,
single precision suffices: phases are those of differences of length.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int
from scipy.constants import speed_of_light

from simulator.geometry.facets import Facets

MOST_CELLS = 0.25
"""Side of a patch over c/B: the phase of its sum changes by less than π over the band. [-]"""

FEWEST_FACETS = 8
"""Least side of a patch, in sides of the largest facet: with smaller patches the cost of each patch
exceeds that of its facets. [-]"""


@dataclass(frozen=True, kw_only=True)
class Patches:
    """Triangles of one material, sorted by patches, relative to their patch's centre."""

    centres: Float[np.ndarray, "patches 3"]  # [m]
    radii: Float[np.ndarray, " patches"]  # of a sphere around the corners of all triangles [m]
    first: Int[np.ndarray, " patches_and_one"]  # index of each patch's first triangle
    order: Int[np.ndarray, " facets"]  # index of each triangle in the whole set
    offsets: Float32[np.ndarray, "facets 3"]  # centroids [m]
    edges: Float32[np.ndarray, "facets 2 3"]  # [m]
    one_sided: np.ndarray  # bool [facets]
    mean: Float32[np.ndarray, "facets 3"] | None = None  # normals of the mean surface, if rough

    def part(self, chosen: Int[np.ndarray, " chosen"]) -> "Patches":
        """Select triangles by their index in the order; empty patches are dropped."""
        owner = np.searchsorted(self.first, chosen, side="right") - 1
        starts = np.flatnonzero(np.diff(owner, prepend=-1))
        kept = owner[starts]
        return Patches(
            centres=self.centres[kept],
            radii=self.radii[kept],
            first=np.append(starts, len(chosen)),
            order=self.order[chosen],
            offsets=self.offsets[chosen],
            edges=self.edges[chosen],
            one_sided=self.one_sided[chosen],
            mean=None if self.mean is None else self.mean[chosen],
        )

    def patch_range(self, start: int, stop: int) -> "Patches":
        """Select consecutive patches."""
        return self.part(np.arange(self.first[start], self.first[stop]))

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self.centres)


def patch_side(facets: Facets, bandwidth: float) -> float:
    """Return the side of the patches. [m]."""
    return max(MOST_CELLS * speed_of_light / bandwidth, FEWEST_FACETS * facets.extent / 2)


def cut_into_patches(facets: Facets, chosen: Int[np.ndarray, " chosen"], side: float) -> Patches:
    """Sort triangles into the cells of a cubic grid.

    Parameters
    ----------
    facets
        Triangles.
    chosen
        Which of them.
    side
        Of the grid's cells. [m]
    """
    places = facets.centres[chosen]
    cells = np.floor((places - places.min(axis=0, initial=np.inf)) / side).astype(np.int64)
    width = cells.max(axis=0, initial=0) + 1
    keys = (cells[:, 0] * width[1] + cells[:, 1]) * width[2] + cells[:, 2]
    sorting = np.argsort(keys, kind="stable")
    order, keys = chosen[sorting], keys[sorting]
    starts = np.flatnonzero(np.diff(keys, prepend=-1))
    first = np.append(starts, len(keys))
    counts = np.diff(first)
    places = places[sorting]
    low, high = (bound.reduceat(places, starts, axis=0) for bound in (np.minimum, np.maximum))
    centres = (low + high) / 2
    offsets = places - np.repeat(centres, counts, axis=0)
    reach = np.sqrt(np.einsum("fx,fx->f", offsets, offsets)) + facets.extent
    return Patches(
        centres=centres,
        radii=np.maximum.reduceat(reach, starts),
        first=first,
        order=order,
        offsets=offsets.astype(np.float32),
        edges=facets.edges[order].astype(np.float32),
        one_sided=~facets.two_sided[order],
        mean=None if facets.relief is None else facets.relief.normals[order],
    )
