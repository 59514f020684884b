"""The images of a linear array: focused anew on each pixel, around what was found."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame
from estimator.array.linear_array import echo_reach, echo_resolution, imaged_sine
from estimator.geometry.specular_chains_2d import possible_chains
from estimator.imaging.backprojection import focus, prepare
from estimator.imaging.range_compression import range_profiles
from estimator.mapping.map_2d import RoomMap
from estimator.mapping.map_images import images_on
from estimator.measurement.model import Echo
from estimator.results.estimate import Images
from estimator.results.pixel_grid import PixelGrid

PIXELS = 2_000_000
"""Most pixels of an image that is shown, 32 MB of complex values; its spacing grows beyond.
[pixels]"""
MARGIN = 0.05
"""What an image shows around the outermost things in it, so that none lies on its
rim. [m]"""
SPACING = 0.5
"""Distance of pixels: two a cell sample the intensity as the sampling theorem asks. [cells]"""


def room_images(
    echo: Echo,
    room: RoomMap,
    frame: ArrayFrame,
    paths: Sequence[Float[np.ndarray, "_ 3"]],
) -> Images:
    """Form the raw and the corrected image on one grid, around what was found."""
    focuser = prepare(range_profiles(echo))
    nearest, farthest = echo_reach(echo)
    sine = imaged_sine(echo)

    def focus_in_reach(points: Float[np.ndarray, "*grid 3"]) -> np.ndarray:
        """Focus where range and angle are unambiguous; elsewhere there is no image: 0."""
        distance = np.linalg.norm(points, axis=-1)
        inside = (distance > nearest) & (distance < farthest)
        inside &= (points[..., 1] > 0) & (np.abs(points[..., 0]) < sine * distance)
        values = np.zeros(points.shape[:-1], dtype=np.complex128)
        values[inside] = focus(focuser, points[inside])
        return values

    shown = [np.zeros((1, 3)), echo.positions, room.survey.peaks, *paths]
    shown += [np.stack([wall.start, wall.end]) for wall in room.walls]
    shown += [np.stack([target.position, target.ghost]) for target in room.targets]
    grid = _grid(frame.to_world(np.concatenate(shown)), echo_resolution(echo).along_ray)
    chains = possible_chains(room.walls, reach=farthest)
    return images_on(grid, frame, focus_in_reach, room.walls, chains)


def _grid(shown: Float[np.ndarray, "points 3"], cell: float) -> PixelGrid:
    """Cover all points that are to be seen, with two pixels a range cell if affordable."""
    low, high = shown.min(axis=0) - MARGIN, shown.max(axis=0) + MARGIN
    spacing = max(SPACING * cell, float(np.sqrt(np.prod((high - low)[:2]) / PIXELS)))
    return PixelGrid.spanning(
        x=(float(low[0]), float(high[0])),
        y=(float(low[1]), float(high[1])),
        z=float(shown[:, 2].mean()),
        spacing=spacing,
    )
