"""Positions of an imported echo, corrected by the sharpest image."""

import numpy as np
from jaxtyping import Float

from estimator.array.viewpoint import viewpoint
from estimator.array.windows import survey_weights
from estimator.imaging.autofocus import MOST_TERMS, focus_ranges
from estimator.imaging.energy_region import focused, middles
from estimator.imaging.scene_image import ImageOptions, in_frame, scene_grid
from estimator.measurement.model import Echo, MeasurementError
from estimator.results.pixel_grid import PixelGrid

MOST_POINTS = 4000
"""Brightest pixels that are focused in each round. [-]"""
FINER = 3.0
"""Pixels along each axis over those of an image, which has two for each resolution cell: the fourth
power has four times an image's bandwidth. [-]"""
FINE_POINTS = 100_000
"""Most of those pixels. [-]"""
BETTER = 1.01
"""Sharpness over that before from which positions are moved. [-]"""


def autofocused(echo: Echo, boresight: Float[np.ndarray, " 3"]) -> tuple[Echo, str]:
    """Correct how far each position is towards the scene.

    Returns
    -------
    The echo with other positions, and what is to be said of them.

    Raises
    ------
    MeasurementError
        If the positions are neither a line nor a plane, or there is too much to sum.
    """
    view = viewpoint(middles(echo), boresight)
    if not view.ahead:
        raise MeasurementError(
            "the positions are neither on a line nor in a plane that faces the scene: leave it out"
        )
    grid, _ = scene_grid(in_frame(echo, view.frame), view, ImageOptions())
    pixels = view.frame.to_world(_finer(grid))
    values = np.abs(focused(echo, pixels, survey_weights(echo)))
    count = max(1, min(MOST_POINTS, int(MOST_TERMS / echo.samples.size), len(pixels)))
    found = focus_ranges(echo, pixels[np.argsort(-values)[:count]], view.frame.axes[1])
    if found.sharpness < BETTER:
        return echo, "moving single positions makes the image no sharper: they were left"
    size = 1e3 * float(np.sqrt(np.mean(found.shift**2)))
    return found.echo, (
        f"positions were moved towards the scene by {size:.3g} mm root mean square, which makes "
        f"the image {found.sharpness:.3g} times as sharp"
    )


def _finer(grid: PixelGrid) -> Float[np.ndarray, "points 3"]:
    """Return pixels as close as the fourth power of an image needs, or as are affordable."""
    sizes = np.array([axis.size for axis in (grid.x, grid.y, grid.z)])
    free = sizes > 1
    most = (FINE_POINTS / float(np.prod(sizes))) ** (1 / int(free.sum()))
    finer = np.where(free, np.ceil(sizes * min(FINER, most)), 1).astype(int)
    axes = [
        np.linspace(axis[0], axis[-1], count)
        for axis, count in zip((grid.x, grid.y, grid.z), finer, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
