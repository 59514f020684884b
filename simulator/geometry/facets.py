"""Surfaces divided into facets, the scatterers of physical optics."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from scenes.realisations.object_surface import Surface
from scenes.schema.radio import Polarization
from scenes.surfaces.height_synthesis import slope_share
from simulator.geometry.profile_lines import Edge, Run, outline
from simulator.materials.fresnel_slab import Conductor, Material

SMOOTHED = 1 / 6
"""Standard width, over the wavelength, of the slopes' smoothing in the curvature correction. [-]"""

CELLS_AT_ONCE = 1_000_000
"""Cells of a surface that are converted to facets in one batch: some 300 MB. [-]"""


class Group(NamedTuple):
    """Facets of one material, all smooth or all rough with the same smoothing."""

    material: Material
    share: float | None  # of the slopes' variance left by smoothing; None: smooth [-]
    mask: Bool[np.ndarray, " facets"] | None  # which facets; None: all


@dataclass(frozen=True, kw_only=True)
class Relief:
    """Position of facets relative to the mean surface of a rough body."""

    normals: Float32[np.ndarray, "facets 3"]  # unit vectors of the mean surface
    heights: Float32[np.ndarray, " facets"]  # of the facets' centres over it [m]
    shares: tuple[float | None, ...]
    """Share of the slopes' variance left by smoothing, by material; None: smooth. [-]"""

    def part(self, chosen: Int[np.ndarray, " chosen"]) -> "Relief":
        """Choose some of the facets."""
        return replace(self, normals=self.normals[chosen], heights=self.heights[chosen])


@dataclass(frozen=True, kw_only=True)
class Facets:
    """Flat facets, each much smaller than a Fresnel zone; lines in 2-D, triangles in 3-D."""

    centres: Float[np.ndarray, "facets 3"]  # [m]
    normals: Float[np.ndarray, "facets 3"]  # unit vectors; outward where one-sided
    sizes: Float[np.ndarray, " facets"]  # length [m] or area [m²]
    edges: Float[np.ndarray, "facets sides 3"]  # one along a line, two along a triangle [m]
    two_sided: Bool[np.ndarray, " facets"]
    materials: tuple[Material, ...] = (Conductor(),)
    material: Int[np.ndarray, " facets"] | None = None  # index; None: all of the first
    mean_centres: Float[np.ndarray, "facets 3"] | None = None  # of lines; None: the centres [m]
    runs: tuple[Run, ...] = ()  # of lines: the runs without corners
    corners: tuple[Edge, ...] = ()  # of lines: ends of runs
    polarization: Polarization = "vertical"  # of lines
    relief: "Relief | None" = None  # None: facets are on the mean surface

    @property
    def places(self) -> Float[np.ndarray, "facets 3"]:
        """Starts of rays, on the mean surface: roughness does not hide its own surface. [m]."""
        if self.relief is not None:
            places: np.ndarray = self.centres - self.relief.heights[:, None] * self.relief.normals
            return places
        return self.centres if self.mean_centres is None else self.mean_centres

    @property
    def mean_normals(self) -> Float[np.ndarray, "facets 3"]:
        """Unit vectors of the mean surface; outward where one-sided."""
        if self.relief is None:
            return self.normals
        return self.relief.normals.astype(np.float64)

    @cached_property
    def rough(self) -> Bool[np.ndarray, " facets"]:
        """Which lines belong to a rough run; their normals and sizes are the mean course's."""
        rough = np.zeros(self.count, dtype=bool)
        for run in self.runs:
            rough[run.facets] = run.rough
        return rough

    def material_of(self, facet: int) -> Material:
        """Return the material of one facet."""
        return self.materials[0 if self.material is None else int(self.material[facet])]

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.sizes)

    def part(self, chosen: Int[np.ndarray, " chosen"]) -> "Facets":
        """Select some of the facets; lines are then returned without runs and edges."""
        return replace(
            self,
            mean_centres=None if self.mean_centres is None else self.mean_centres[chosen],
            runs=(),
            corners=(),
            centres=self.centres[chosen],
            normals=self.normals[chosen],
            sizes=self.sizes[chosen],
            edges=self.edges[chosen],
            two_sided=self.two_sided[chosen],
            material=None if self.material is None else self.material[chosen],
            relief=None if self.relief is None else self.relief.part(chosen),
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
    def by_material(self) -> tuple[Group, ...]:
        """Groups of facets of one material, all smooth or all rough with the same smoothing."""
        shares = self._shares
        if self.material is None:
            return (Group(self.materials[0], shares[0], None),)
        kinds: list[tuple[Material, float | None, list[int]]] = []
        for index, (material, share) in enumerate(zip(self.materials, shares, strict=True)):
            same = [
                k
                for k in kinds
                if k[1] == share and (k[0] is material or _both_conduct(k[0], material))
            ]
            if same:
                same[0][2].append(index)
            else:
                kinds.append((material, share, [index]))
        if len(kinds) == 1:
            return (Group(kinds[0][0], kinds[0][1], None),)
        return tuple(Group(kind, share, np.isin(self.material, i)) for kind, share, i in kinds)

    @property
    def _shares(self) -> tuple[float | None, ...]:
        if self.relief is None:
            return (None,) * len(self.materials)
        return self.relief.shares


def _both_conduct(one: Material, other: Material) -> bool:
    return isinstance(one, Conductor) and isinstance(other, Conductor)


def surface_facets(
    surface: Surface,
    material: Material | None = None,
    *,
    polarization: Polarization = "vertical",
    wavelength: float = 0.0,
) -> Facets:
    """Make a facet of each cell of a surface (line cells: 2-D, triangles: 3-D).

    Parameters
    ----------
    surface
        The surface with its roughness.
    material
        Of the whole surface; by default a conductor.
    polarization
        Of the antennas, where these are lines.
    wavelength
        See :func:`scene_facets`. [m]
    """
    of = Conductor() if material is None else material
    made = scene_facets([(surface, of)], polarization=polarization, wavelength=wavelength)
    return replace(made, material=None)


def scene_facets(
    surfaces: Sequence[tuple[Surface, Material]],
    *,
    polarization: Polarization = "vertical",
    wavelength: float = 0.0,
) -> Facets:
    """Make facets of the cells of several surfaces, one material for each of them.

    Parameters
    ----------
    surfaces
        At least one surface, all of lines or all of triangles, and the material of each.
    polarization
        Of the antennas, where these are lines.
    wavelength
        In the middle of the band: slopes are smoothed over a sixth of it in the curvature
        correction; 0: not smoothed. [m]
    """
    sides = surfaces[0][0].cells.shape[1] - 1
    ends = np.cumsum([len(surface.cells) for surface, _ in surfaces])
    count = int(ends[-1])
    facets = Facets(
        centres=np.empty((count, 3)),
        normals=np.empty((count, 3)),
        sizes=np.empty(count),
        # Single precision suffices for triangles: a phase of 2π has an error of 1e-6.
        edges=np.empty((count, sides, 3), dtype=np.float32 if sides > 1 else np.float64),
        two_sided=np.empty(count, dtype=bool),
        materials=tuple(material for _, material in surfaces),
        material=np.empty(count, dtype=np.int16),
        polarization=polarization,
    )
    runs: list[Run] = []
    corners: list[Edge] = []
    mean_centres = np.empty((count, 3)) if sides == 1 else None
    for index, ((surface, _), end) in enumerate(zip(surfaces, ends.tolist(), strict=True)):
        start = end - len(surface.cells)
        facets.two_sided[start:end] = not surface.closed
        if facets.material is not None:
            facets.material[start:end] = index
        if mean_centres is not None:
            lines = outline(surface, start)
            here = slice(start, end)
            facets.centres[here], facets.normals[here] = lines.centres, lines.normals
            facets.sizes[here], facets.edges[here] = lines.sizes, lines.edges
            mean_centres[here] = lines.mean_centres
            runs += (replace(run, count=count) for run in lines.runs)
            corners += _renumbered(lines.corners, facets=0, edges=len(corners))
            continue
        for first in range(start, end, CELLS_AT_ONCE):
            last = min(first + CELLS_AT_ONCE, end)
            cells = surface.cells[first - start : last - start]
            _fill(facets, slice(first, last), surface.vertices[cells])
    if mean_centres is None:
        return replace(facets, relief=_relief([one for one, _ in surfaces], count, wavelength))
    return replace(facets, mean_centres=mean_centres, runs=tuple(runs), corners=tuple(corners))


def _renumbered(corners: Sequence[Edge], *, facets: int, edges: int) -> list[Edge]:
    """Return edges with their indices of facets and edges offset for a larger set."""
    return [
        replace(
            edge,
            facets=tuple(facet + facets for facet in edge.facets),
            partner=edge.partner if edge.partner < 0 else edge.partner + edges,
        )
        for edge in corners
    ]


def is_rough(surface: Surface) -> bool:
    """Return whether a surface differs from its mean shape."""
    return surface.vertices is not surface.mean_vertices and bool(
        np.any(surface.vertices != surface.mean_vertices)
    )


def _relief(surfaces: Sequence[Surface], count: int, wavelength: float) -> Relief | None:
    """Return triangles' normals and heights of the mean surface; None if all are smooth."""
    rough = [is_rough(surface) for surface in surfaces]
    if not any(rough):
        return None
    relief = Relief(
        normals=np.empty((count, 3), dtype=np.float32),
        heights=np.zeros(count, dtype=np.float32),
        shares=tuple(
            slope_share(surface.roughness, SMOOTHED * wavelength) if is_rough else None
            for surface, is_rough in zip(surfaces, rough, strict=True)
        ),
    )
    start = 0
    for surface in surfaces:
        for first in range(0, len(surface.cells), CELLS_AT_ONCE):
            cells = surface.cells[first : first + CELLS_AT_ONCE]
            mean, corners = surface.mean_vertices[cells], surface.vertices[cells]
            across = np.cross(mean[:, 1] - mean[:, 0], mean[:, 2] - mean[:, 0])
            normals = across / np.linalg.norm(across, axis=-1, keepdims=True)
            some = slice(start + first, start + first + len(cells))
            relief.normals[some] = normals
            apart = (corners - mean).mean(axis=1)
            relief.heights[some] = np.einsum("fx,fx->f", apart, normals)
        start += len(surface.cells)
    return relief


def _fill(facets: Facets, some: slice, corners: Float[np.ndarray, "cells corners 3"]) -> None:
    edges = corners[:, 1:] - corners[:, :1]
    across = np.cross(edges[:, 0], edges[:, 1])
    doubled = np.linalg.norm(across, axis=-1)
    facets.centres[some], facets.normals[some] = corners.mean(axis=1), across / doubled[:, None]
    facets.sizes[some], facets.edges[some] = doubled / 2, edges


def joined(parts: Sequence[Facets]) -> Facets:
    """Join the facets of several surfaces into one set.

    Raises
    ------
    ValueError
        If there are none, or of several polarizations.
    """
    if not parts:
        raise ValueError("no facets to join: the scene has no scattering object")
    polarizations = {part.polarization for part in parts}
    if len(polarizations) > 1:
        raise ValueError("facets of several polarizations cannot be joined; make all of one")
    starts = np.cumsum([0, *(part.count for part in parts)]).tolist()
    runs: list[Run] = []
    corners: list[Edge] = []
    for start, part in zip(starts, parts, strict=False):
        runs += (replace(run, facets=run.facets + start, count=starts[-1]) for run in part.runs)
        corners += _renumbered(part.corners, facets=start, edges=len(corners))
    first = np.cumsum([0, *(len(part.materials) for part in parts)])
    indices = [
        start + (np.zeros(part.count, dtype=np.int64) if part.material is None else part.material)
        for start, part in zip(first, parts, strict=False)
    ]
    return Facets(
        relief=_joined_reliefs(parts),
        centres=np.concatenate([part.centres for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        sizes=np.concatenate([part.sizes for part in parts]),
        edges=np.concatenate([part.edges for part in parts]),
        two_sided=np.concatenate([part.two_sided for part in parts]),
        materials=tuple(material for part in parts for material in part.materials),
        material=np.concatenate(indices),
        mean_centres=np.concatenate([part.places for part in parts]) if parts[0].flat else None,
        runs=tuple(runs),
        corners=tuple(corners),
        polarization=polarizations.pop(),
    )


def _joined_reliefs(parts: Sequence[Facets]) -> Relief | None:
    if all(part.relief is None for part in parts):
        return None
    made = [
        part.relief
        or Relief(
            normals=part.normals.astype(np.float32),
            heights=np.zeros(part.count, dtype=np.float32),
            shares=(None,) * len(part.materials),
        )
        for part in parts
    ]
    return Relief(
        normals=np.concatenate([relief.normals for relief in made]),
        heights=np.concatenate([relief.heights for relief in made]),
        shares=tuple(share for relief in made for share in relief.shares),
    )


def profile_surface(profile: Float[np.ndarray, "vertices 3"], *, name: str = "wall") -> Surface:
    """Return the open conducting surface of a measured or computed 2-D wall profile. [m].

    Its mean course is the line between its ends.
    """
    first = np.arange(len(profile) - 1)
    along = profile[-1] - profile[0]
    shares = (profile - profile[0]) @ along / (along @ along)
    return Surface(
        name=name,
        material="metal",
        vertices=profile,
        mean_vertices=profile[0] + shares[:, None] * along,
        cells=np.stack([first, first + 1], axis=-1),
        closed=False,
    )
