"""Users of path lists: alone by their own consensus, or beside an echo over the walls it shows."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.array_frame import ArrayFrame
from estimator.channel.path import Path, PathSet
from estimator.geometry.bearing import Bearing
from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.bearing_3d import PLANAR
from estimator.measurement.path_list import PathList

MOST_JOINED = 6
"""Strongest paths of a list that are joined to hypotheses over the walls of an echo: their number
grows exponentially. [-]"""
UNAMBIGUOUS = 1e3
"""Path length beyond which a list's delay is taken to come round: a list is not sampled. [m]"""


@dataclass(frozen=True, kw_only=True)
class ListedWave:
    """A wave of a list, whose curvature is that of its delay; see :class:`.path.Wave`."""

    bearing: Float[np.ndarray, " angles"]  # [rad] or [-]
    path_length: float  # [m]
    gain: complex  # [-]
    covariance: Float[np.ndarray, "parameters parameters"]  # of bearing and length

    @property
    def curvature(self) -> float:
        """Of the wavefront at the array's centre. [1/m]."""
        return 1 / self.path_length

    @property
    def curvature_deviation(self) -> float:
        """None was fitted. [1/m]."""
        return 0.0


def paths_of_list(
    one: PathList, frame: ArrayFrame, *, linear: bool, clock_offset: float
) -> tuple[PathSet, int]:
    """Return a list's strongest paths as an array in this frame would have heard them.

    Parameters
    ----------
    one
        The list.
    frame
        Of the array that measured the echo; the list's base station is at its centre.
    linear
        Whether the array is linear: elevations are then those of its plane.
    clock_offset
        Of the user. [s]

    Returns
    -------
    The paths, and how many were left out: from behind the array, or faint.
    """
    how: Bearing = LINEAR if linear else PLANAR
    rays = one.directions @ frame.axes.T
    length = one.length + speed_of_light * clock_offset
    level = np.zeros(length.size) if one.gain_db is None else one.gain_db
    ahead = np.flatnonzero((rays[:, 1] > 0) & (length > 0))
    chosen = ahead[np.argsort(-level[ahead], kind="stable")[:MOST_JOINED]]
    power = 10 ** (0.1 * (level - level.max()))
    total = float(power[chosen].sum()) if chosen.size else 1.0
    paths, blocks = [], []
    for index in chosen:
        ray = rays[index] / np.linalg.norm(rays[index])
        bearing = np.array([np.arctan2(ray[1], ray[0])]) if linear else ray[[0, 2]]
        turns = how.turns(ray[:2] if linear else ray)
        spread = np.zeros((len(bearing) + 1, len(bearing) + 1))
        spread[:-1, :-1] = one.angle_deviation**2 * turns @ turns.T
        spread[:-1, :-1] += 1e-12 * np.eye(len(bearing))  # at the horizon a cosine does not turn
        spread[-1, -1] = (speed_of_light * one.delay_deviation) ** 2
        amplitude = 0.0 if one.gain_db is None else 10 ** (0.05 * float(level[index]))
        wave = ListedWave(
            bearing=bearing,
            path_length=float(length[index]),
            gain=complex(amplitude),
            covariance=spread,
        )
        blocks.append(spread)
        paths.append(
            Path(
                wave=wave,
                free=wave,
                share=float(power[index]) / total,
                unambiguous=UNAMBIGUOUS,
            )
        )
    size = sum(len(block) for block in blocks)
    covariance = np.zeros((size, size))
    at = 0
    for block in blocks:
        covariance[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    found = PathSet(
        paths=tuple(paths),
        covariance=covariance,
        free_covariance=np.zeros((0, 0)),
        how=how,
        frequency=one.frequency if one.gain_db is not None else None,
    )
    return found, length.size - chosen.size
