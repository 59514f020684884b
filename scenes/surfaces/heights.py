"""The heights of one object, drawn face after face from the object's own stream."""

import math
from typing import TypedDict

import numpy as np
from jaxtyping import Float

from scenes.schema.roughness import Roughness, Spectrum
from scenes.surfaces.roughness_spectrum import rough_profile, rough_sheet

SAMPLES_PER_DETAIL = 8
"""Grid points per correlation length (or inner cut-off) from which heights at arbitrary places
are interpolated: cubic splines through them are within 1e-3 of the rms height. [-]"""


class Statistics(TypedDict):
    """What is asked of :func:`scenes.surfaces.roughness_spectrum.rough_profile`."""

    rms: float
    correlation_length: float
    spectrum: Spectrum
    inner_cutoff: float


class Heights:
    """Draws heights of given statistics; a smooth object's are all zero and draw nothing."""

    def __init__(self, roughness: Roughness | None, rng: np.random.Generator) -> None:
        self._rng = rng
        self.statistics: Statistics | None = None
        if roughness is not None and roughness.rms > 0:
            self.statistics = Statistics(
                rms=roughness.rms,
                correlation_length=roughness.correlation_length,
                spectrum=roughness.spectrum,
                inner_cutoff=roughness.inner_cutoff,
            )

    @property
    def edge_zone(self) -> float:
        """Distance from an edge over which a face is stretched to reach the next one [m].

        Ten times the height or the correlation length, so that the stretch is a tenth of the
        slopes that the surface has anyway, or less.
        """
        if self.statistics is None:
            return math.inf
        return 10.0 * max(self.statistics["rms"], self.statistics["correlation_length"])

    def line(
        self, length: float, count: int, *, periodic: bool = False
    ) -> Float[np.ndarray, " count"]:
        """Draw the heights along the next line [m]."""
        if self.statistics is None:
            return np.zeros(count)
        return rough_profile(
            length=length, count=count, rng=self._rng, periodic=periodic, **self.statistics
        )

    def sheet(
        self,
        lengths: tuple[float, float],
        counts: tuple[int, int],
        *,
        periodic: tuple[bool, bool] = (False, False),
    ) -> Float[np.ndarray, "first second"]:
        """Draw the heights over the next rectangle [m]."""
        if self.statistics is None:
            return np.zeros(counts)
        return rough_sheet(
            lengths=lengths, counts=counts, rng=self._rng, periodic=periodic, **self.statistics
        )

    def at(self, places: Float[np.ndarray, "places 2"]) -> Float[np.ndarray, " places"]:
        """Draw the heights at arbitrary places of the next plane [m]."""
        if self.statistics is None:
            return np.zeros(len(places))
        from scipy.ndimage import map_coordinates

        exponential = self.statistics["spectrum"] == "exponential"
        detail = self.statistics["inner_cutoff" if exponential else "correlation_length"]
        step = detail / SAMPLES_PER_DETAIL
        # A margin around the places, where the spline knows the heights on one side only.
        low = places.min(axis=0) - detail
        extent = places.max(axis=0) + detail - low
        first, second = (int(np.ceil(side / step)) + 1 for side in extent)
        sheet = self.sheet((float(extent[0]), float(extent[1])), (first, second))
        index = (places - low) / extent * (first - 1, second - 1)
        heights: np.ndarray = map_coordinates(sheet, index.T, order=3, mode="nearest")
        return heights
