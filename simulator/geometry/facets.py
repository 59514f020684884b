"""Surfaces cut into facets: the scatterers of physical optics."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from scenes.realisations.object_surface import Surface
from simulator.materials.layered_media import Conductor, Material

CELLS_AT_ONCE = 1_000_000
"""Cells of a surface that are made facets in one go: some 300 MB. [-]"""


@dataclass(frozen=True, kw_only=True)
class Facets:
    """Flat facets, each much smaller than a Fresnel zone; lines in 2-D, triangles in 3-D."""

    centres: Float[np.ndarray, "facets 3"]  # [m]
    normals: Float[np.ndarray, "facets 3"]  # unit vectors; outward where one-sided
    sizes: Float[np.ndarray, " facets"]  # length [m] or area [m²]
    edges: Float[np.ndarray, "facets sides 3"]  # one along a line, two along a triangle [m]
    two_sided: Bool[np.ndarray, " facets"]
    materials: tuple[Material, ...] = (Conductor(),)
    material: Int[np.ndarray, " facets"] | None = None  # index; None: all are the first

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.sizes)

    def part(self, chosen: Int[np.ndarray, " chosen"]) -> "Facets":
        """Choose some of the facets."""
        return replace(
            self,
            centres=self.centres[chosen],
            normals=self.normals[chosen],
            sizes=self.sizes[chosen],
            edges=self.edges[chosen],
            two_sided=self.two_sided[chosen],
            material=None if self.material is None else self.material[chosen],
        )

    @property
    def extent(self) -> float:
        """Longest edge. [m]."""
        return float(np.linalg.norm(self.edges, axis=-1).max(initial=0.0))

    @property
    def flat(self) -> bool:
        """Whether these are lines of a scene that is invariant along z."""
        return int(self.edges.shape[1]) == 1

    @property
    def by_material(self) -> tuple[tuple[Material, Bool[np.ndarray, " facets"] | None], ...]:
        """Each material that occurs, and which facets are of it; None: all."""
        if self.material is None:
            return ((self.materials[0], None),)
        kinds: list[tuple[Material, list[int]]] = []
        for index, material in enumerate(self.materials):
            same = [k for k in kinds if k[0] is material or _both_conduct(k[0], material)]
            if same:
                same[0][1].append(index)
            else:
                kinds.append((material, [index]))
        if len(kinds) == 1:
            return ((kinds[0][0], None),)
        return tuple((material, np.isin(self.material, which)) for material, which in kinds)


def _both_conduct(one: Material, other: Material) -> bool:
    return isinstance(one, Conductor) and isinstance(other, Conductor)


def surface_facets(surface: Surface, material: Material | None = None) -> Facets:
    """Make a facet of each cell of a surface (line cells: 2-D, triangles: 3-D).

    Parameters
    ----------
    surface
        The surface, as it is displaced.
    material
        What all of it is made of; by default a conductor.
    """
    made = scene_facets([(surface, Conductor() if material is None else material)])
    return replace(made, material=None)


def scene_facets(surfaces: Sequence[tuple[Surface, Material]]) -> Facets:
    """Make facets of the cells of several surfaces, one material for each of them.

    Parameters
    ----------
    surfaces
        At least one, all lines or all triangles, and what each is made of.
    """
    sides = surfaces[0][0].cells.shape[1] - 1
    ends = np.cumsum([len(surface.cells) for surface, _ in surfaces])
    count = int(ends[-1])
    facets = Facets(
        centres=np.empty((count, 3)),
        normals=np.empty((count, 3)),
        sizes=np.empty(count),
        # Single precision does for triangles: a phase of 2π is off by 1e-6.
        edges=np.empty((count, sides, 3), dtype=np.float32 if sides > 1 else np.float64),
        two_sided=np.empty(count, dtype=bool),
        materials=tuple(material for _, material in surfaces),
        material=np.empty(count, dtype=np.int16),
    )
    for index, ((surface, _), end) in enumerate(zip(surfaces, ends.tolist(), strict=True)):
        start = end - len(surface.cells)
        facets.two_sided[start:end] = not surface.closed
        if facets.material is not None:
            facets.material[start:end] = index
        for first in range(start, end, CELLS_AT_ONCE):
            last = min(first + CELLS_AT_ONCE, end)
            cells = surface.cells[first - start : last - start]
            _fill(facets, slice(first, last), surface.vertices[cells])
    return facets


def _fill(facets: Facets, some: slice, corners: Float[np.ndarray, "cells corners 3"]) -> None:
    edges = corners[:, 1:] - corners[:, :1]
    if edges.shape[1] == 1:
        along = edges[:, 0]
        across = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=-1)
        sizes = np.linalg.norm(along, axis=-1)
        normals = across / sizes[:, None]
    else:
        across = np.cross(edges[:, 0], edges[:, 1])
        doubled = np.linalg.norm(across, axis=-1)
        sizes, normals = doubled / 2, across / doubled[:, None]
    facets.centres[some], facets.normals[some] = corners.mean(axis=1), normals
    facets.sizes[some], facets.edges[some] = sizes, edges


def joined(parts: Sequence[Facets]) -> Facets:
    """Join the facets of several surfaces into one set.

    Raises
    ------
    ValueError
        If there are none.
    """
    if not parts:
        raise ValueError("no facets to join: the scene has no scattering object")
    first = np.cumsum([0, *(len(part.materials) for part in parts)])
    indices = [
        start + (np.zeros(part.count, dtype=np.int64) if part.material is None else part.material)
        for start, part in zip(first, parts, strict=False)
    ]
    return Facets(
        centres=np.concatenate([part.centres for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        sizes=np.concatenate([part.sizes for part in parts]),
        edges=np.concatenate([part.edges for part in parts]),
        two_sided=np.concatenate([part.two_sided for part in parts]),
        materials=tuple(material for part in parts for material in part.materials),
        material=np.concatenate(indices),
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
