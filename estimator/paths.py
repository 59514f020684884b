"""A user's paths: waves taken out of the pilot one after the other, each one tested.

A path that a flat mirror reflects, or none, is a spherical wave whose curvature agrees with
its delay. A wave that an edge or a rough patch scatters is rounder: it is told apart by that.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.constants import speed_of_light

from estimator.angle_range_map import angle_range_map
from estimator.curvature_search import search_curvature
from estimator.estimate import AngleRangeMap
from estimator.measurement import Uplink
from estimator.spherical_wave_fit import SphericalWave, fit_spherical_wave, wave_field

MOST_PATHS = 4
LEAST_SHARE = 0.05
"""Share of the pilot's energy (less the noise) below which a wave is not looked at. [-]"""
FALSE_ALARM = 1e-6
"""Probability that noise alone gives a wave somewhere in the map. [-]"""
CURVATURE_DEVIATIONS = 6.0
"""Deviations by which curvature and delay may disagree; the robust covariance is an estimate
from few blocks itself, and a rough mirror bends the wavefront in ways it only samples."""
CURVATURE_SLACK = 0.1
"""Further disagreement allowed, over the curvature; a scatterer must differ by more. [-]."""


@dataclass(frozen=True, kw_only=True)
class Path:
    """One wave of the pilot, in the array's frame."""

    wave: SphericalWave  # fitted with the curvature of its delay
    free: SphericalWave  # fitted with a curvature of its own
    share: float  # of the pilot's energy, less the noise [-]
    unambiguous: float  # longest path that the frequency step tells apart [m]

    @property
    def specular(self) -> bool:
        """Whether the wave's curvature is that of a path of this length."""
        return self._agrees_with(self.wave.path_length)

    @property
    def unfolded(self) -> float | None:
        """A path length beyond the unambiguous one that fits the curvature, if one does. [m]."""
        longer = [self.wave.path_length + turns * self.unambiguous for turns in (1, 2, 3)]
        nearest = min(longer, key=lambda length: abs(1 / length - 1 / self.free.radius))
        return nearest if self._agrees_with(nearest) else None

    def _agrees_with(self, length: float) -> bool:
        deviation = np.sqrt(self.free.covariance[2, 2]) / self.free.radius**2
        allowed = CURVATURE_DEVIATIONS * deviation + CURVATURE_SLACK / length
        return bool(abs(1 / self.free.radius - 1 / length) <= allowed)


def find_paths(uplink: Uplink, first_map: AngleRangeMap) -> tuple[Path, ...]:
    """Take the strongest waves out of a pilot, one after the other.

    Parameters
    ----------
    uplink
        With positions in the array's frame.
    first_map
        Its angle/range map over everything that is looked at.

    Returns
    -------
    The waves in the order in which they were taken out; each holds at least
    :data:`LEAST_SHARE` of the energy.
    """
    noise = noise_variance(uplink)
    energy = float(np.sum(np.abs(uplink.samples) ** 2)) - noise * uplink.samples.size
    # A matched filter's output of noise is exponential: this is passed by chance in one map
    # of a million.
    least = noise * float(np.log(first_map.values.size / FALSE_ALARM))
    step = float(uplink.frequencies[1] - uplink.frequencies[0])
    paths: list[Path] = []
    left, this_map = uplink, first_map
    while len(paths) < MOST_PATHS:
        row, column = np.unravel_index(
            int(np.argmax(np.abs(this_map.values))), this_map.values.shape
        )
        aoa, length = float(this_map.aoa[row]), float(this_map.path_length[column])
        if abs(this_map.values[row, column]) ** 2 * left.samples.size < least:
            break
        try:
            wave = fit_spherical_wave(left, aoa=aoa, path_length=length)
            start = search_curvature(left, aoa=wave.aoa, path_length=wave.path_length)
            free = fit_spherical_wave(
                left, aoa=start.aoa, path_length=start.path_length, radius=start.radius
            )
        except ValueError:
            break  # no maximum near the peak: a ridge, not a wave
        share = free.explained * float(np.sum(np.abs(left.samples) ** 2)) / energy
        if share < LEAST_SHARE:
            break  # speckle
        paths.append(Path(wave=wave, free=free, share=share, unambiguous=speed_of_light / step))
        # With its own curvature, whatever it is, less of the wave is left behind.
        field = wave_field(
            left.positions,
            left.frequencies,
            aoa=free.aoa,
            path_length=free.path_length,
            radius=free.radius,
        )
        left = replace(left, samples=left.samples - free.gain * field)
        remaining = float(np.sum(np.abs(left.samples) ** 2)) - noise * left.samples.size
        if remaining < LEAST_SHARE * energy:
            break
        this_map = angle_range_map(
            left, aoa=first_map.aoa, path_length=first_map.path_length, centre=np.zeros(3)
        )
    return tuple(paths)


def noise_variance(uplink: Uplink) -> float:
    """Estimate the noise in each sample from the delays at which nothing arrives.

    The median over all delays is blind to the few that hold signal; a Hann window keeps the
    signal's sidelobes out of the others.
    """
    window = np.hanning(uplink.frequencies.size + 2)[1:-1]
    delays = np.abs(np.fft.fft(uplink.samples * window, axis=1)) ** 2
    return float(np.median(delays)) / float(np.log(2)) / float(np.sum(window**2))
