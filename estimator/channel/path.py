"""One path of a user's pilot, whatever the array: a wave whose curvature agrees with its delay.

A path that a flat mirror reflects, or none, is a spherical wave whose curvature agrees with
its delay. A wave that an edge or a rough patch scatters is rounder: it is told apart by that.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from estimator.geometry.bearing import Bearing
from estimator.geometry.bearing_2d import LINEAR

MOST_PATHS = 4
"""Waves that are taken out of one pilot: each choice of them and of the walls is a hypothesis.
[-]"""
LEAST_SHARE = 0.05
"""Share of the pilot's energy (less the noise) below which a wave is not looked at: the speckle of
a rough wall has less. ``python -m validation.experiments.thresholds answers``: with 0.025 and 0.1
the answers in seven rooms are the same, five of seven users found and right, none wrong. [-]"""
CURVATURE_DEVIATIONS = 6.0
"""Deviations by which curvature and delay may disagree; the covariance is an estimate from few
modes or tiles itself, and a rough mirror bends the wavefront in ways it only samples. [-]"""
CURVATURE_SLACK = 0.1
"""Further disagreement allowed, over the curvature; a scatterer must differ by more. ``python -m
validation.experiments.thresholds answers``: with 0.05 and 0.2 the answers in seven rooms are the
same, five of seven users found and right, none wrong. [-]"""
FARTHEST = 1000.0
"""Radius of curvature that a plane wave, or a hollow one, is taken to have: beyond any room. [m]"""


@runtime_checkable
class Wave(Protocol):
    """A fitted wave: :class:`SphericalWave` of a linear array, :class:`Wavefront` of a planar."""

    @property
    def bearing(self) -> Float[np.ndarray, " angles"]:
        """What the array measures of the direction it comes from. [rad] or [-]."""
        ...

    @property
    def path_length(self) -> float:
        """From its delay. [m]."""
        ...

    @property
    def gain(self) -> complex:
        """S-parameter of the path. [-]."""
        ...

    @property
    def curvature(self) -> float:
        """Of the wavefront at the array's centre. [1/m]."""
        ...

    @property
    def curvature_deviation(self) -> float:
        """Standard deviation of a curvature that was fitted; 0 of one that was not. [1/m]."""
        ...

    @property
    def covariance(self) -> Float[np.ndarray, "parameters parameters"]:
        """Of the parameters of the fit: bearing, length, and what the curvature is told by."""
        ...


@dataclass(frozen=True, kw_only=True)
class Shadow:
    """What an edge before the source takes of a wave."""

    lit: Bool[np.ndarray, " elements"]  # the elements that it reaches
    reached: Float[np.ndarray, " 3"]  # their centre [m]
    dark: Float[np.ndarray, " 3"]  # centre of the others [m]


@dataclass(frozen=True, kw_only=True)
class Path:
    """One wave of the pilot, in the array's frame."""

    wave: Wave  # with the curvature of its delay if that agrees, else with its own
    free: Wave  # fitted with a curvature of its own
    share: float  # of the pilot's energy, less the noise [-]
    unambiguous: float  # longest path that the frequency step tells apart [m]
    tilt_db: float | None = None
    """Change of its level over the band, over that of free space; None if unknown. [dB]"""
    shadow: Shadow | None = None  # None: it reaches all elements

    @property
    def specular(self) -> bool:
        """Whether the wave's curvature is that of a path of this length."""
        return self._agrees_with(self.free.path_length)

    @property
    def radius(self) -> float:
        """Radius of curvature of the free wave, at most :data:`FARTHEST`. [m]."""
        return 1 / max(self.free.curvature, 1 / FARTHEST)

    @property
    def dealiased_length(self) -> float | None:
        """A path length beyond the unambiguous one that fits the curvature, if one does. [m]."""
        longer = [self.free.path_length + turns * self.unambiguous for turns in (1, 2, 3)]
        nearest = min(longer, key=lambda length: abs(1 / length - self.free.curvature))
        return nearest if self._agrees_with(nearest) else None

    def _agrees_with(self, length: float) -> bool:
        allowed = CURVATURE_DEVIATIONS * self.free.curvature_deviation + CURVATURE_SLACK / length
        return bool(abs(self.free.curvature - 1 / length) <= allowed)


@dataclass(frozen=True, kw_only=True)
class PathSet:
    """All paths of one pilot, with what is known of them together."""

    paths: tuple[Path, ...]  # strongest first
    covariance: Float[np.ndarray, "bound bound"]  # of (bearing, path length) of each wave
    free_covariance: Float[np.ndarray, "free free"]
    """Of (bearing, path length, curvature) of each wave with a curvature of its own."""
    how: Bearing = LINEAR  # what the array measures of a direction
    frequency: float | None = None  # centre of the band, if levels are to count [Hz]
    bandwidth: float | None = None  # of which the paths' tilts are [Hz]
    power: float | None = None  # of the pilot, less the noise: mean square of S-parameters [-]

    @property
    def observed(self) -> Float[np.ndarray, "paths kinds"]:
        """Bearing [rad] or [-] and length [m] of each wave."""
        return np.array([[*one.wave.bearing, one.wave.path_length] for one in self.paths])

    @property
    def free_observed(self) -> Float[np.ndarray, "paths kinds"]:
        """Bearing, length [m] and curvature [1/m] of each wave with a curvature of its own."""
        return np.array(
            [[*one.free.bearing, one.free.path_length, 1 / one.radius] for one in self.paths]
        )


def no_paths(how: Bearing) -> PathSet:
    """Return that no wave stands out of a pilot."""
    nothing = np.zeros((0, 0))
    return PathSet(paths=(), covariance=nothing, free_covariance=nothing, how=how)
