"""A scene that is imaged, not mapped: targets where they are, and no walls.

That is what a scan of things near the aperture gives, or an array around them: the room's methods
take things to be farther away than the aperture is long.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float

from estimator.array.array_frame import ArrayFrame
from estimator.array.viewpoint import Viewpoint
from estimator.array.windows import SURVEY_TAPER, survey_weights
from estimator.imaging.energy_region import focused
from estimator.imaging.scene_image import ImageOptions, in_world, scene_grid, scene_values
from estimator.mapping.image_targets import image_targets
from estimator.measurement.model import Echo, Uplink
from estimator.positioning.map_context import MapContext, no_image
from estimator.results.estimate import CorrectedImage, Image, Images, Mirror, Target, UserEstimate
from estimator.results.pixel_grid import PixelGrid


@dataclass(frozen=True, kw_only=True)
class ImagedScene:
    """What an image showed; see :class:`estimator.localization.stages.MappedRoom`."""

    echo: Echo
    flat: bool  # whether the image is a plane
    grid: PixelGrid  # in the array's frame
    values: Complex[np.ndarray, "x y z"]
    found: tuple[Target, ...]  # in the array's frame
    notes: tuple[str, ...]

    @property
    def context(self) -> MapContext:
        """Nothing is known of walls."""
        return no_image()

    def refined(self, found: UserEstimate, uplink: Uplink) -> UserEstimate:
        """Return the answer itself."""
        return found

    def mirrors(self, frame: ArrayFrame) -> tuple[Mirror, ...]:
        """Return none: none was looked for."""
        return ()

    def targets(self, frame: ArrayFrame) -> tuple[Target, ...]:
        """Return the targets in the world's frame."""
        return tuple(
            replace(
                target,
                position=frame.to_world(target.position),
                ghost=frame.to_world(target.ghost),
                ends=None if target.ends is None else frame.to_world(target.ends),
            )
            for target in self.found
        )

    def images(self, frame: ArrayFrame, paths: Sequence[Float[np.ndarray, "_ 3"]]) -> Images:
        """Return the image, twice: there are no ghosts to unfold."""
        grid, values = in_world(self.values, self.grid, frame)
        if grid is None:  # not parallel to the world's axes: focused anew
            grid = self._around(frame)
            values = focused(self.echo, frame.to_local(grid.points), survey_weights(self.echo))
        values = values.reshape(grid.shape)
        chain = np.zeros(grid.shape, dtype=np.int64)
        corrected = CorrectedImage(values=values, grid=grid, chains=((),), chain=chain)
        return Images(raw=Image(values=values, grid=grid), corrected=corrected)

    def _around(self, frame: ArrayFrame) -> PixelGrid:
        axes = (self.grid.x, self.grid.y, self.grid.z)
        ends = [(axis[0], axis[-1]) for axis in axes]
        corners = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3)
        places = frame.to_world(corners)
        low, high = places.min(axis=0), places.max(axis=0)
        count = float(np.prod([axis.size for axis in axes]))
        sizes = (high - low)[: 2 if self.flat else 3]
        step = float((np.prod(sizes) / count) ** (1 / len(sizes)))
        return PixelGrid.spanning(
            x=(float(low[0]), float(high[0])),
            y=(float(low[1]), float(high[1])),
            z=float(low[2]) if self.flat else (float(low[2]), float(high[2])),
            spacing=step,
        )


def affordable(echo: Echo, view: Viewpoint) -> bool:
    """Tell whether an image of all that an echo shows resolves it within the most pixels.

    Parameters
    ----------
    echo
        In the array's frame.
    view
        Where the array looks, and its frame.
    """
    return not scene_grid(echo, view, ImageOptions())[1]


def imaged_scene(
    echo: Echo,
    *,
    view: Viewpoint,
    reason: str,
    options: ImageOptions | None = None,
    walls: str = ", and no walls were looked for",
) -> ImagedScene:
    """Image what an echo shows, and find targets in it.

    Parameters
    ----------
    echo
        In the array's frame.
    view
        Where the array looks, and its frame.
    reason
        Why no walls are looked for.
    options
        What is asked for in the world's frame; ``None``: all is chosen by where the energy is.
    walls
        What the note says of them.
    """
    grid, notes = scene_grid(echo, view, options or ImageOptions())
    values, method = scene_values(echo, grid, window=SURVEY_TAPER)
    found = image_targets(echo, grid, values, survey_weights(echo))
    nothing = () if found else ("nothing stands out of the noise in the image",)
    return ImagedScene(
        echo=echo,
        flat=view.flat,
        grid=grid,
        values=values,
        found=found,
        notes=(f"{reason}: imaged by {method}{walls}", *notes, *nothing),
    )
