"""The images of a planar array: read from the surveyed volume, around what was found."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from estimator.array.array_frame import ArrayFrame
from estimator.array.resolution_cell import Resolution
from estimator.geometry.specular_chains_3d import possible_chains
from estimator.mapping.map_3d import SpaceMap
from estimator.mapping.map_images import images_on
from estimator.results.estimate import Images
from estimator.results.pixel_grid import PixelGrid

VOXELS = 1_500_000
"""Most voxels of an image, 24 MB of complex values; its spacing grows beyond. [voxels]"""
MARGIN = 0.05
"""What an image shows around the outermost things in it, over their extent. [-]"""
SKIN = 2.0
"""Range behind a wall that is still its own image, and further margin of the image across the
ray: the taper's main lobe reaches 1.7. [cells]"""
SPACING = 0.5
"""Distance of voxels: two a cell sample the intensity as the sampling theorem asks. [cells]"""
ALONG_BORESIGHT = 0.5
"""Cosine between an axis of the world and the boresight above which it is sampled as the range is:
60°, within which one axis lies whatever the boresight (at 55° at most from the nearest). [-]"""


def space_images(
    room: SpaceMap,
    frame: ArrayFrame,
    resolution: Resolution,
    paths: Sequence[Float[np.ndarray, "_ 3"]],
) -> Images:
    """Read the raw and the corrected image on one grid, around what was found."""
    looked = room.survey
    reach = float(looked.ranges[-1])
    shown = [looked.peaks, *paths]
    shown += [wall.corners for wall in room.walls] + [plane.wall.corners for plane in room.planes]
    shown += [np.vstack([target.position, target.ends]) for target in room.targets]
    if not sum(len(part) for part in shown):  # nothing at all: the whole volume
        shown = [reach * np.array([[-0.2, 1.0, -0.2], [0.2, 0.5, 0.2]])]
    grid = _grid(np.concatenate(shown), frame, resolution)
    return images_on(
        grid,
        frame,
        looked.at,
        room.walls,
        possible_chains(room.walls, reach=reach),
        skin=SKIN * resolution.along_ray,
    )


def _grid(
    shown: Float[np.ndarray, "points 3"], frame: ArrayFrame, resolution: Resolution
) -> PixelGrid:
    """Cover all points that are to be seen, with two voxels a cell if affordable."""
    places = frame.to_world(shown)
    low, high = places.min(axis=0), places.max(axis=0)
    middle = float(np.median(np.linalg.norm(shown, axis=1)))
    # The tapered main lobe reaches 1.7 cells beyond what it shows.
    margin = MARGIN * float((high - low).max()) + SKIN * resolution.across_ray * middle
    low, high = low - margin, high + margin
    fine, coarse = SPACING * resolution.along_ray, SPACING * resolution.across_ray * middle
    # The world's axis nearest to the boresight is sampled as the range is.
    spacing = np.where(np.abs(frame.axes[1]) > ALONG_BORESIGHT, fine, max(fine, coarse))
    spacing = spacing * max(1.0, (float(np.prod((high - low) / spacing)) / VOXELS) ** (1 / 3))
    return PixelGrid.spanning(
        x=(float(low[0]), float(high[0])),
        y=(float(low[1]), float(high[1])),
        z=(float(low[2]), float(high[2])),
        spacing=(float(spacing[0]), float(spacing[1]), float(spacing[2])),
    )
