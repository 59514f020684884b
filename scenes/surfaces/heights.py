"""The heights of one object, face after face: drawn from its own stream, or measured."""

import math
from typing import TypedDict

import numpy as np
from jaxtyping import Float

from scenes.schema.height_map import HeightMap
from scenes.schema.roughness import Roughness, Scale, Spectrum
from scenes.surfaces.height_distribution import transformed
from scenes.surfaces.height_synthesis import rough_profile, rough_sheet

SAMPLES_PER_DETAIL = 8
"""Grid points per correlation length (or inner cut-off) from which heights at arbitrary places
are interpolated: cubic splines through them are within 1e-3 of the rms height. [-]"""


class Statistics(TypedDict):
    """Keyword arguments of :func:`scenes.surfaces.height_synthesis.rough_profile`."""

    rms: float
    correlation_length: float
    spectrum: Spectrum
    inner_cutoff: float
    hurst: float


class Heights:
    """Heights of given statistics, or of a file; a smooth object's are zero and draw nothing."""

    def __init__(self, roughness: Roughness | None, rng: np.random.Generator) -> None:
        self._rng = rng
        self._roughness = roughness
        self.measured: HeightMap | None = None
        self.drawn: tuple[Statistics, ...] = ()
        if roughness is None or roughness.rms == 0:
            return
        self.measured = roughness.measured
        if self.measured is None:
            self.drawn = tuple(_statistics(one) for one in roughness.scales if one.rms_mm > 0)

    @property
    def smooth(self) -> bool:
        """Whether all heights are zero."""
        return self.measured is None and not self.drawn

    @property
    def longest(self) -> float:
        """Longest correlation length [m]."""
        if self.measured is not None:
            return self.measured.correlation_length
        return max((one["correlation_length"] for one in self.drawn), default=0.0)

    @property
    def edge_zone(self) -> float:
        """Distance from an edge over which a face is stretched to reach the next one [m].

        Ten times the height or the correlation length, so that the stretch is a tenth of the
        slopes that the surface has anyway, or less.
        """
        if self.smooth or self._roughness is None:
            return math.inf
        return 10.0 * max(self._roughness.rms, self.longest)

    def line(
        self, length: float, count: int, *, periodic: bool = False
    ) -> Float[np.ndarray, " count"]:
        """Return the heights along the next line [m]."""
        if self.measured is not None:
            steps = count if periodic else count - 1
            return self._look_up(length * np.arange(count) / steps, np.zeros(count))
        heights = np.zeros(count)
        for one in self.drawn:
            heights = heights + rough_profile(
                length=length, count=count, rng=self._rng, periodic=periodic, **one
            )
        return self._distributed(heights)

    def sheet(
        self,
        lengths: tuple[float, float],
        counts: tuple[int, int],
        *,
        periodic: tuple[bool, bool] = (False, False),
    ) -> Float[np.ndarray, "first second"]:
        """Return the heights over the next rectangle [m]."""
        if self.measured is not None:
            first, second = (
                length * np.arange(count) / (count if closed else count - 1)
                for length, count, closed in zip(lengths, counts, periodic, strict=True)
            )
            return self._look_up(*np.meshgrid(first, second, indexing="ij"))
        heights = np.zeros(counts)
        for one in self.drawn:
            heights = heights + rough_sheet(
                lengths=lengths, counts=counts, rng=self._rng, periodic=periodic, **one
            )
        return self._distributed(heights)

    def at(self, places: Float[np.ndarray, "places 2"]) -> Float[np.ndarray, " places"]:
        """Return the heights at arbitrary places of the next plane [m]."""
        if self.smooth:
            return np.zeros(len(places))
        low = places.min(axis=0)
        if self.measured is not None:
            return self._look_up(*(places - low).T)
        from scipy.ndimage import map_coordinates

        detail = min(one["inner_cutoff"] or one["correlation_length"] for one in self.drawn)
        step = detail / SAMPLES_PER_DETAIL
        # A margin around the places: at its border a spline is less accurate.
        low = low - detail
        extent = places.max(axis=0) + detail - low
        first, second = (int(np.ceil(side / step)) + 1 for side in extent)
        sheet = self.sheet((float(extent[0]), float(extent[1])), (first, second))
        index = (places - low) / extent * (first - 1, second - 1)
        heights: np.ndarray = map_coordinates(sheet, index.T, order=3, mode="nearest")
        return heights

    def _distributed(self, heights: np.ndarray) -> np.ndarray:
        if self._roughness is None or self.smooth:
            return heights
        return transformed(
            heights,
            rms=self._roughness.rms,
            distribution=self._roughness.height_distribution,
            skewness=self._roughness.skewness or 0.0,
        )

    def _look_up(
        self, first: Float[np.ndarray, "*n"], second: Float[np.ndarray, "*n"]
    ) -> Float[np.ndarray, "*n"]:
        """Interpolate the measured heights; beyond them they are continued by mirror images."""
        from scipy.ndimage import map_coordinates

        if self.measured is None:
            raise ValueError("no measured heights; give roughness.file")
        index = [first.ravel() / self.measured.step, second.ravel() / self.measured.step]
        heights = self.measured.heights
        if self.measured.profile:
            heights, index = heights[:, 0], index[:1]
        found = map_coordinates(heights, index, order=3, mode="mirror")
        return np.asarray(found.reshape(first.shape))


def _statistics(scale: Scale) -> Statistics:
    return Statistics(
        rms=1e-3 * scale.rms_mm,
        correlation_length=scale.correlation_length,
        spectrum=scale.spectrum,
        inner_cutoff=scale.inner_cutoff,
        hurst=scale.hurst,
    )
