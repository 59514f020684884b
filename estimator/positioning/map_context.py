"""The map as input of positioning: walls, resolution and imaged region, in 2-D or 3-D."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.lateness import Lateness
from estimator.geometry.wall_2d import Wall
from estimator.geometry.wall_3d import PlaneWall

LookAside = Callable[[Float[np.ndarray, " 3"], float], Float[np.ndarray, "peaks 3"] | None]
"""From a unit vector and a distance [m] to peaks of the echo's image around it [m], strongest
first; None where there is no image."""

Levels = Callable[[Float[np.ndarray, "points 3"]], Float[np.ndarray, " points"]]
"""From points [m] to 20 log10 of the S-parameters of point scatterers as bright there [dB]."""


@dataclass(frozen=True, kw_only=True)
class MapContext:
    """What is known of the room, in the array's frame."""

    walls: tuple[Wall, ...] | tuple[PlaneWall, ...]  # mirrors at their true place
    wall_covariance: Float[np.ndarray, "parameters parameters"]
    """Of all walls' (tilts, offset), one wall after the other."""
    resolution: Resolution  # of the image: how well it tells where a wall ends
    imaged: bool  # whether there was an echo: without, nothing is known of mirrors
    unassigned_peaks: Float[np.ndarray, "peaks 3"]
    """Peaks of the image on no wall, strongest first. [m]"""
    reach: float  # how far the image shows what there is [m]
    widest: float  # sine of the angle from boresight, along each axis, to which it does [-]
    contrast: float  # intensity of the brightest in the image over its background [-]
    late: Lateness | None = None
    """By how much the walls' echoes are later than they are curved; None where nothing tells."""
    aside: LookAside | None = None
    """Looks for what stands around a direction that the image does not show, if that can be."""
    rooms: tuple[tuple[float, tuple[Wall, ...] | tuple[PlaneWall, ...]], ...] = ()
    """The walls at all places where they may stand, each choice with its probability; empty if they
    stand where :attr:`walls` says."""
    levels: Levels | None = None
    """How bright the image is at points; None where nothing tells."""

    def shows(self, heading: Float[np.ndarray, " 3"]) -> bool:
        """Tell whether the image shows what there is in a direction, a unit vector."""
        return max(abs(float(heading[0])), abs(float(heading[2]))) <= self.widest


def no_image() -> MapContext:
    """Return what is known of a room of which no echo was measured: nothing."""
    return MapContext(
        walls=(),
        wall_covariance=np.zeros((0, 0)),
        resolution=Resolution(along_ray=0.0, across_ray=0.0),
        imaged=False,
        unassigned_peaks=np.zeros((0, 3)),
        reach=np.inf,
        widest=1.0,
        contrast=0.0,
    )


def block_covariance(walls: Sequence[FlatWall]) -> Float[np.ndarray, "parameters parameters"]:
    """Put the covariances of walls that were seen independently into one matrix."""
    ends = np.cumsum([0, *(len(wall.covariance) for wall in walls)])
    joint = np.zeros((ends[-1], ends[-1]))
    for wall, start, end in zip(walls, ends[:-1], ends[1:], strict=True):
        joint[start:end, start:end] = wall.covariance
    return joint
