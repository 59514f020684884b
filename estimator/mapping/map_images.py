"""The raw and the corrected image of a room on one grid, in the plane or in space."""

from collections.abc import Iterable, Sequence

from estimator.array.array_frame import ArrayFrame
from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.specular_chains import Chain
from estimator.imaging.focusing import Focus
from estimator.mapping.ghost_correction import corrected_image
from estimator.results.estimate import CorrectedImage, Image, Images
from estimator.results.pixel_grid import PixelGrid


def images_on(
    grid: PixelGrid,
    frame: ArrayFrame,
    focus: Focus,
    walls: Sequence[FlatWall],
    chains: Iterable[Chain],
    *,
    skin: float = 0.0,
) -> Images:
    """Form both images: the second has each pixel's brightest view, directly or over walls.

    Parameters
    ----------
    grid
        In the world's frame. [m]
    frame
        The array's.
    focus
        Focuses the echo on points of the array's frame; 0 where there is no image.
    walls, chains, skin
        As in :func:`estimator.mapping.ghost_correction.corrected_image`.
    """
    points = frame.to_local(grid.points)
    raw = Image(values=focus(points), grid=grid)
    unfolded = corrected_image(focus, points, walls, chains, raw=raw.values, skin=skin)
    corrected = CorrectedImage(
        values=unfolded.values, grid=grid, chains=unfolded.chains, chain=unfolded.chain
    )
    return Images(raw=raw, corrected=corrected)
