"""The faces of a body: lines of facets between its corners."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from scenes.schema.radio import Polarization
from simulator.geometry.facets import Facets
from simulator.geometry.profile_lines import Run
from simulator.materials.fresnel_slab import Material


@dataclass(frozen=True, kw_only=True)
class Face:
    """One side of a surface of line facets."""

    centres: Float[np.ndarray, "facets 2"]  # [m]
    places: Float[np.ndarray, "facets 2"]  # starts of rays, on the mean surface [m]
    normals: Float[np.ndarray, "facets 2"]  # unit vectors, to the side that scatters
    sizes: Float[np.ndarray, " facets"]  # weight of each facet in a sum over the surface [m]
    edges: Float[np.ndarray, "facets 2"]  # [m]
    source: Int[np.ndarray, " facets"]  # index of each facet in the whole set
    surface: int  # index of the face's object
    side: int  # 1: the outer or first side; -1: the back of an open surface
    material: Material
    rough: Bool[np.ndarray, " facets"]  # then normals and sizes are those of the mean course
    polarization: Polarization
    runs: tuple[Run, ...] = ()  # of the whole set of facets

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.sizes)

    def part(self, chosen: slice | Int[np.ndarray, " chosen"]) -> "Face":
        """Select some of the facets."""
        return Face(
            **{
                name: getattr(self, name)[chosen]
                for name in ("centres", "places", "normals", "sizes", "edges", "source", "rough")
            },
            surface=self.surface,
            side=self.side,
            material=self.material,
            polarization=self.polarization,
            runs=self.runs,
        )


def two_faces(
    facets: Facets, chosen: Int[np.ndarray, " chosen"], *, surface: int, material: Material
) -> tuple[Face, ...]:
    """Return the sides of a surface that scatter: the outer one, or both of an open surface."""
    sides = (1, -1) if bool(facets.two_sided[chosen].any()) else (1,)
    return tuple(
        Face(
            centres=facets.centres[chosen, :2],
            places=facets.places[chosen, :2],
            normals=side * facets.normals[chosen, :2],
            sizes=facets.sizes[chosen],
            edges=facets.edges[chosen, 0, :2],
            source=chosen,
            surface=surface,
            side=side,
            material=material,
            rough=facets.rough[chosen],
            polarization=facets.polarization,
            runs=facets.runs,
        )
        for side in sides
    )


def scattering_faces(facets: Facets) -> tuple[Face, ...]:
    """Return both sides of open surfaces, and the outer one of closed surfaces."""
    owner = np.zeros(facets.count, dtype=np.int64) if facets.material is None else facets.material
    return tuple(
        face
        for surface in np.unique(owner).tolist()
        for face in two_faces(
            facets,
            np.flatnonzero(owner == surface),
            surface=surface,
            material=facets.materials[surface],
        )
    )
