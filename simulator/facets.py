"""Surfaces cut into facets: the scatterers of physical optics."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from scenes.shapes import Surface


@dataclass(frozen=True, kw_only=True)
class Facets:
    """Flat facets, each much smaller than a Fresnel zone; lines in 2-D, triangles in 3-D."""

    centres: Float[np.ndarray, "facets 3"]  # [m]
    normals: Float[np.ndarray, "facets 3"]  # unit vectors; outward where one-sided
    sizes: Float[np.ndarray, " facets"]  # length [m] or area [m²]
    edges: Float[np.ndarray, "facets sides 3"]  # one along a line, two along a triangle [m]
    two_sided: Bool[np.ndarray, " facets"]

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.sizes)

    @property
    def extent(self) -> float:
        """Longest edge. [m]."""
        return float(np.linalg.norm(self.edges, axis=-1).max(initial=0.0))


def surface_facets(surface: Surface) -> Facets:
    """Make a facet of each cell of a surface (line cells: 2-D, triangles: 3-D)."""
    corners = surface.vertices[surface.cells]
    edges = corners[:, 1:] - corners[:, :1]
    if surface.cells.shape[1] == 2:
        along = edges[:, 0]
        across = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=-1)
        sizes = np.linalg.norm(along, axis=-1)
        normals = across / sizes[:, None]
    else:
        across = np.cross(edges[:, 0], edges[:, 1])
        doubled = np.linalg.norm(across, axis=-1)
        sizes, normals = doubled / 2, across / doubled[:, None]
    return Facets(
        centres=corners.mean(axis=1),
        normals=normals,
        sizes=sizes,
        edges=edges,
        two_sided=np.full(len(sizes), not surface.closed),
    )


def joined(parts: Sequence[Facets]) -> Facets:
    """Join the facets of several surfaces into one set.

    Raises
    ------
    ValueError
        If there are none.
    """
    if not parts:
        raise ValueError("no facets to join: the scene has no scattering object")
    return Facets(
        **{
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("centres", "normals", "sizes", "edges", "two_sided")
        }
    )


def profile_surface(profile: Float[np.ndarray, "vertices 3"], *, name: str = "wall") -> Surface:
    """Make an open conducting surface of a measured or computed wall profile in 2-D. [m]."""
    first = np.arange(len(profile) - 1)
    return Surface(
        name=name,
        material="metal",
        vertices=profile,
        mean_vertices=profile,
        cells=np.stack([first, first + 1], axis=-1),
        closed=False,
    )
