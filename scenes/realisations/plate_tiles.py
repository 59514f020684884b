"""A rough plate in tiles, for plates whose facets do not fit into memory at once."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from scenes.random_streams import random_stream
from scenes.realisations.object_surface import Surface
from scenes.scenario import Scenario
from scenes.schema.objects import Plate
from scenes.surfaces.facet_spacing import steps
from scenes.surfaces.heights import Heights
from scenes.surfaces.shape import grid_triangles


@dataclass(frozen=True, kw_only=True)
class Tile:
    """A part of the plate's grid."""

    along: slice  # of vertices, both ends included
    up: slice
    centre: Float[np.ndarray, " 3"]  # [m]
    radius: float  # of the ball around its mean shape [m]


@dataclass(frozen=True, kw_only=True)
class PlateSheet:
    """The heights of one realisation over the whole plate."""

    name: str
    plate: Plate
    heights: Float[np.ndarray, "along up"]  # along the plate's normal [m]

    @property
    def spacings(self) -> tuple[float, float]:
        """Distance of neighbouring vertices along the plate and along z [m]."""
        along, up = self.heights.shape
        return self.plate.length_m / (along - 1), float(self.plate.height_m or 0.0) / (up - 1)

    @property
    def highest(self) -> float:
        """Largest height over the mean plane, or depth below it [m]."""
        return float(max(self.heights.max(), -self.heights.min()))

    def tiles(self, side: int) -> Iterator[Tile]:
        """Divide the plate into tiles of at most so many cells along each side."""
        count, rise = (size - 1 for size in self.heights.shape)
        for first in range(0, count, side):
            for low in range(0, rise, side):
                along = slice(first, min(first + side, count) + 1)
                up = slice(low, min(low + side, rise) + 1)
                corners = self._mean(along, up)[[0, 0, -1, -1], [0, -1, 0, -1]]
                centre = corners.mean(axis=0)
                radius = float(np.linalg.norm(corners - centre, axis=-1).max())
                yield Tile(along=along, up=up, centre=centre, radius=radius)

    def surface(self, tile: Tile) -> Surface:
        """Make a surface of a tile; its facets are those of the whole plate there."""
        along, up = tile.along, tile.up
        heights = self.heights[along, up]
        mean = self._mean(along, up).reshape(-1, 3)
        return Surface(
            name=self.name,
            material=self.plate.material,
            vertices=mean + heights.reshape(-1, 1) * self.plate.normal,
            mean_vertices=mean,
            cells=grid_triangles(np.arange(heights.size).reshape(heights.shape)),
            closed=False,
            roughness=self.plate.roughness,
        )

    def _mean(self, along: slice, up: slice) -> Float[np.ndarray, "along up 3"]:
        count, rise = self.heights.shape
        plate, height = self.plate, float(self.plate.height_m or 0.0)
        offsets = plate.length_m * np.linspace(-0.5, 0.5, count)[along, None] * plate.tangent
        level = height * np.linspace(-0.5, 0.5, rise)[up, None] * np.array([0.0, 0.0, 1.0])
        return np.asarray(plate.centre + offsets[:, None] + level)


def plate_sheet(scenario: Scenario, name: str, *, seed: int, sample: int = 0) -> PlateSheet:
    """Draw the heights of a plate in three dimensions, as :func:`object_surface` does.

    Parameters
    ----------
    scenario, name
        The scenario and the name of the plate in it.
    seed, sample
        Which realisation.

    Raises
    ------
    ValueError
        If the object is no plate with a height.
    """
    plate = scenario.objects[name]
    if not isinstance(plate, Plate) or plate.height_m is None:
        raise ValueError(f"objects.{name} is no plate with a height; give one")
    spacing = scenario.facet_spacing(name)
    counts = steps(plate.length_m, spacing) + 1, steps(plate.height_m, spacing) + 1
    heights = Heights(plate.roughness, random_stream(seed, sample, f"roughness/{name}"))
    sheet = heights.sheet((plate.length_m, plate.height_m), counts)
    return PlateSheet(name=name, plate=plate, heights=sheet)
