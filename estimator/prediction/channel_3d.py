r"""A user's channel in space, predicted from the map: directions, delays and levels of its paths.

The line of sight and up to three plane mirrors by the method of images. Extents are finite: a path
is one whose line to the user's image meets just the walls of its chain. Position and walls are
estimates that are taken to err independently; their covariances are carried to each path's
direction and length to first order, by central differences.

Levels: free space :math:`\lambda / 4 \pi L` between isotropic antennas, times what
:mod:`estimator.prediction.wall_reflection` knows of each wall.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.geometry.path_tracing_3d import central_slopes, project_in_space, slopes_by_wall
from estimator.geometry.specular_chains_3d import (
    Chain,
    chains_in_space,
    image_in_space,
    unfolded_in_space,
)
from estimator.geometry.wall_3d import PlaneWall
from estimator.prediction.wall_reflection import Reflections, wall_reflections

MOST_BOUNCES = 3


@dataclass(frozen=True, kw_only=True)
class PredictedSpacePath:
    """One path of the channel, in the array's frame."""

    walls: Chain  # from the array outward; () is direct
    vertices: Float[np.ndarray, "vertices 3"]  # array, bounces, user [m]
    cosines: tuple[float, float]  # of the direction of arrival, along x and z [-]
    path_length: float  # [m]
    covariance: Float[np.ndarray, "3 3"]  # of (cosine along x, along z, path length [m])
    gain: float  # of the amplitude between isotropic antennas [-]
    gain_deviation_db: float

    @property
    def delay(self) -> float:
        """Time of flight. [s]."""
        return self.path_length / speed_of_light

    @property
    def level_db(self) -> float:
        """Level of the gain. [dB]."""
        return float(20 * np.log10(self.gain))


def predict_channel_in_space(
    position: Float[np.ndarray, " 3"],
    covariance: Float[np.ndarray, "3 3"],
    walls: Sequence[PlaneWall],
    *,
    frequency: float,
    reflections: Reflections | None = None,
    max_bounces: int = MOST_BOUNCES,
) -> tuple[PredictedSpacePath, ...]:
    """Predict the paths from a user to a planar array at the origin, in the plane y = 0.

    Parameters
    ----------
    position, covariance
        The user's, in the array's frame. [m], [m²]
    walls
        All mirrors, at their true place. They hide what is behind them.
    frequency
        At which the levels hold. [Hz]
    reflections
        Of the walls; None: what is assumed of walls of which nothing is known.
    max_bounces
        Mirrors in a chain.

    Returns
    -------
    The paths that arrive from before the array (y > 0), strongest first.
    """
    known = reflections or wall_reflections(len(walls))
    wavelength = speed_of_light / frequency
    paths = []
    for chain in ((), *chains_in_space(len(walls), deepest=max_bounces)):
        image = image_in_space(position, walls, chain)
        met = unfolded_in_space(image[None], walls, deepest=len(chain) + 1)[1][0]
        if image[1] <= 0 or tuple(met) != (*chain, -1):
            continue
        parameters = _arrival(position, walls, chain)
        cosines, length = (float(parameters[0]), float(parameters[1])), float(parameters[2])
        traced = project_in_space(cosines, length, walls, covariance=np.zeros((3, 3)))
        level, deviation = known.over(chain)
        paths.append(
            PredictedSpacePath(
                walls=chain,
                vertices=traced.path,
                cosines=cosines,
                path_length=length,
                covariance=_covariance(position, covariance, walls, chain),
                gain=wavelength / (4 * np.pi * length) * 10 ** (level / 20),
                gain_deviation_db=deviation,
            )
        )
    return tuple(sorted(paths, key=lambda path: -path.gain))


def _arrival(
    position: Float[np.ndarray, " 3"], walls: Sequence[PlaneWall], chain: Chain
) -> Float[np.ndarray, " 3"]:
    """Return (cosine along x, along z, length) of the path over a chain, whatever its extent."""
    image = image_in_space(position, walls, chain)
    length = float(np.linalg.norm(image))
    return np.array([image[0] / length, image[2] / length, length])


def _covariance(
    position: Float[np.ndarray, " 3"],
    spread: Float[np.ndarray, "3 3"],
    walls: Sequence[PlaneWall],
    chain: Chain,
) -> Float[np.ndarray, "3 3"]:
    by_user = central_slopes(lambda step: _arrival(position + step, walls, chain))
    total: np.ndarray = by_user @ spread @ by_user.T
    for index in set(chain):
        by_wall = slopes_by_wall(lambda moved: _arrival(position, moved, chain), walls, index)
        total = total + by_wall @ walls[index].covariance @ by_wall.T
    return total
