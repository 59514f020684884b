"""One interface to the methods that form an image."""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Complex, Float

from estimator.imaging.backprojection import backproject
from estimator.imaging.range_migration import range_migration
from estimator.measurement.model import Echo
from estimator.results.estimate import Image
from estimator.results.pixel_grid import PixelGrid


@runtime_checkable
class ImageFormer(Protocol):
    """A method that forms a complex image of an echo on a grid."""

    def __call__(
        self,
        echo: Echo,
        grid: PixelGrid,
        *,
        weights: Float[np.ndarray, "#positions #freqs"] | None = None,
    ) -> Complex[np.ndarray, "*grid"]:
        """Form the image; an ideal unit point target peaks at 1."""
        ...


def back_projection(
    echo: Echo, grid: PixelGrid, *, weights: Float[np.ndarray, "#positions #freqs"] | None = None
) -> Complex[np.ndarray, "*grid"]:
    """Form an image by :func:`estimator.imaging.backprojection.backproject`, for any aperture."""
    return backproject(echo, grid.points, weights=weights)


FORMERS: dict[str, ImageFormer] = {
    "back-projection": back_projection,
    "range migration": range_migration,
}


def form_image(
    echo: Echo,
    grid: PixelGrid,
    *,
    former: ImageFormer = back_projection,
    weights: Float[np.ndarray, "#positions #freqs"] | None = None,
) -> Image:
    """Form an image by any method and keep it together with its grid.

    Parameters
    ----------
    echo
        Stepped-frequency echo.
    grid
        Pixels. [m]
    former
        Method, one of :data:`FORMERS` or one's own.
    weights
        Taper over positions and frequencies; ``None``: all one. [-]
    """
    return Image(values=former(echo, grid, weights=weights), grid=grid)
