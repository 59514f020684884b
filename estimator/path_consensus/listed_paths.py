r"""All paths of a user's places in one table, and the points where they seem to come from.

A path of length r in the direction ŝ is seen from the base station, at the origin, as if the user
stood at :math:`v = r \hat s`: its image over the mirrors that the path met.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.constants import speed_of_light

from estimator.measurement.path_list import PathList
from estimator.path_consensus.path_levels import free_space_db

FARTHEST = 100.0
"""Longest path that is thought of: levels of longer ones, indoors, are under the noise. [m]"""


@dataclass(frozen=True, kw_only=True)
class ListedPaths:
    """Paths of all places, one after the other, in two or three coordinates."""

    place: Int[np.ndarray, " paths"]  # index of where the user stood
    direction: Float[np.ndarray, "paths axes"]
    length: Float[np.ndarray, " paths"]  # on the base station's clock [m]
    angle_deviation: float  # [rad]
    length_deviation: float  # [m]
    places: int
    level_db: Float[np.ndarray, " paths"] | None = None
    """Over that of free space at a length of 1 m; None where levels are not calibrated. [dB]"""
    level_deviation_db: float = 1.0  # [dB]

    @property
    def axes(self) -> int:
        """Coordinates that are solved for: two without elevations."""
        return int(self.direction.shape[1])

    @property
    def log_clutter(self) -> float:
        """Logarithm of the density of a path from anywhere. [1/(rad m)] or [1/(sr m)]."""
        return -float(np.log((2 * np.pi if self.axes == 2 else 4 * np.pi) * FARTHEST))

    def images(self, offset: float) -> Float[np.ndarray, "paths axes"]:
        """Return where the user seems to stand, if all paths are longer by an offset [m]. [m]."""
        return np.asarray((self.length + offset)[:, None] * self.direction)

    def covariance(self, offset: float) -> Float[np.ndarray, "paths axes axes"]:
        """Return the covariance of these. [m²]."""
        along = self.direction[:, :, None] * self.direction[:, None, :]
        across = ((self.length + offset) * self.angle_deviation) ** 2
        return np.asarray(
            self.length_deviation**2 * along + across[:, None, None] * (np.eye(self.axes) - along)
        )

    def later(self, offset: float) -> "ListedPaths":
        """Make all paths longer by an offset. [m]."""
        return replace(self, length=self.length + offset)

    def excess_db(self, offset: float) -> Float[np.ndarray, " paths"] | None:
        """Return the levels over those of free space, if they are calibrated. [dB]."""
        if self.level_db is None:
            return None
        return np.asarray(self.level_db + 20 * np.log10(np.maximum(self.length + offset, 1e-3)))

    def part(
        self, kept: Bool[np.ndarray, " paths"], chosen: Int[np.ndarray, " places"]
    ) -> "ListedPaths":
        """Take the paths of some places, in rising order."""
        return replace(
            self,
            place=np.searchsorted(chosen, self.place[kept]),
            direction=self.direction[kept],
            length=self.length[kept],
            level_db=None if self.level_db is None else self.level_db[kept],
            places=chosen.size,
        )

    def log_spread(self, offset: float) -> Float[np.ndarray, " paths"]:
        """Return the logarithm of an image's area for each solid angle and length of the path.

        A path that would have no length, on a wrong clock, comes from nowhere: −∞.
        """
        length = self.length + offset
        spread = (self.axes - 1) * np.log(np.maximum(length, 1e-9))
        return np.where(length > 0, spread, -np.inf)


def listed(lists: Sequence[PathList]) -> ListedPaths:
    """Put the paths of all places into one table; in the plane if one has no elevations."""
    flat = any(one.elevation is None for one in lists)
    levels = free_space_db(lists)
    return ListedPaths(
        place=np.repeat(np.arange(len(lists)), [one.azimuth.size for one in lists]),
        direction=np.concatenate([one.directions for one in lists])[:, : 2 if flat else 3],
        length=np.concatenate([one.length for one in lists]),
        angle_deviation=max(one.angle_deviation for one in lists),
        length_deviation=max(float(one.delay_deviation) for one in lists) * speed_of_light,
        places=len(lists),
        level_db=None if levels is None else levels[0],
        level_deviation_db=1.0 if levels is None else levels[1],
    )


def log_normal(
    difference: Float[np.ndarray, "*grid axes"], covariance: Float[np.ndarray, "*#grid axes axes"]
) -> Float[np.ndarray, "*grid"]:
    """Return the logarithm of a Gaussian's density."""
    axes = difference.shape[-1]
    root = np.linalg.cholesky(covariance)
    diagonal = np.diagonal(root, axis1=-2, axis2=-1)
    square: np.ndarray = np.zeros(difference.shape[:-1])
    whitened: list[np.ndarray] = []
    for row in range(axes):
        rest = difference[..., row]
        for column, before in enumerate(whitened):
            rest = rest - root[..., row, column] * before
        whitened.append(rest / diagonal[..., row])
        square = square + whitened[-1] ** 2
    return np.asarray(-0.5 * (square + axes * np.log(2 * np.pi)) - np.log(diagonal).sum(axis=-1))
