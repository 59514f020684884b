"""A user's paths: waves taken out of the pilot one after the other, fitted together, each tested.

A path that a flat mirror reflects, or none, is a spherical wave whose curvature agrees with
its delay. A wave that an edge or a rough patch scatters is rounder: it is told apart by that.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.channel.angle_range_map_2d import angle_range_map
from estimator.measurement.model import Uplink
from estimator.results.estimate import AngleRangeMap
from estimator.wavefronts.curvature_search_2d import search_curvature
from estimator.wavefronts.noise_variance import noise_variance
from estimator.wavefronts.wave_fit_2d import (
    FittedWaves,
    SphericalWave,
    WaveStart,
    fit_spherical_wave,
    fit_spherical_waves,
)

MOST_PATHS = 4
LEAST_SHARE = 0.05
"""Share of the pilot's energy (less the noise) below which a wave is not looked at. [-]"""
FALSE_ALARM = 1e-6
"""Probability that noise alone gives a wave somewhere in the map. [-]"""
UNRESOLVED = 0.5
"""Cells λ/D and c/B apart below which two waves are one. [-]"""
CURVATURE_DEVIATIONS = 6.0
"""Deviations by which curvature and delay may disagree; the covariance is an estimate from few
modes itself, and a rough mirror bends the wavefront in ways it only samples."""
CURVATURE_SLACK = 0.1
"""Further disagreement allowed, over the curvature; a scatterer must differ by more. [-]."""


@dataclass(frozen=True, kw_only=True)
class Path:
    """One wave of the pilot, in the array's frame."""

    wave: SphericalWave  # with the curvature of its delay if that agrees, else with its own
    free: SphericalWave  # fitted with a curvature of its own
    share: float  # of the pilot's energy, less the noise [-]
    unambiguous: float  # longest path that the frequency step tells apart [m]

    @property
    def specular(self) -> bool:
        """Whether the wave's curvature is that of a path of this length."""
        return self._agrees_with(self.free.path_length)

    @property
    def unfolded(self) -> float | None:
        """A path length beyond the unambiguous one that fits the curvature, if one does. [m]."""
        longer = [self.free.path_length + turns * self.unambiguous for turns in (1, 2, 3)]
        nearest = min(longer, key=lambda length: abs(1 / length - 1 / self.free.radius))
        return nearest if self._agrees_with(nearest) else None

    def _agrees_with(self, length: float) -> bool:
        deviation = np.sqrt(self.free.covariance[2, 2]) / self.free.radius**2
        allowed = CURVATURE_DEVIATIONS * deviation + CURVATURE_SLACK / length
        return bool(abs(1 / self.free.radius - 1 / length) <= allowed)


@dataclass(frozen=True, kw_only=True)
class PathSet:
    """All paths of one pilot, with what is known of them together."""

    paths: tuple[Path, ...]  # strongest first
    covariance: Float[np.ndarray, "bound bound"]  # of (aoa, path length) of each wave
    free_covariance: Float[np.ndarray, "free free"]  # of (aoa, path length, radius) of each one


NO_PATHS = PathSet(paths=(), covariance=np.zeros((0, 0)), free_covariance=np.zeros((0, 0)))


def find_paths(uplink: Uplink, first_map: AngleRangeMap, *, clock_known: bool = True) -> PathSet:
    """Take the strongest waves out of a pilot, one after the other, and fit them together.

    Parameters
    ----------
    uplink
        With positions in the array's frame.
    first_map
        Its angle/range map over everything that is looked at.
    clock_known
        Whether a delay is a length; if not, no curvature is taken from it.

    Returns
    -------
    The waves; each held at least :data:`LEAST_SHARE` of the energy when it was found.
    """
    noise = noise_variance(uplink.samples)
    energy = float(np.sum(np.abs(uplink.samples) ** 2)) - noise * uplink.samples.size
    # A matched filter's output of noise is exponential: this is passed by chance in one map
    # of a million.
    least = noise * float(np.log(first_map.values.size / FALSE_ALARM))
    found: FittedWaves | None = None
    residual, this_map = uplink, first_map
    while found is None or len(found.waves) < MOST_PATHS:
        peak = np.abs(this_map.values) ** 2
        row, column = np.unravel_index(int(np.argmax(peak)), peak.shape)
        if peak[row, column] * residual.samples.size < least:
            break
        before = _starts(found.waves) if found else []
        try:
            start = _refined(
                residual, float(this_map.aoa[row]), float(this_map.path_length[column])
            )
            alone = fit_spherical_waves(residual, [start])
            share = alone.waves[0].explained * float(np.sum(np.abs(residual.samples) ** 2)) / energy
            if share < LEAST_SHARE:
                break  # speckle
            # Each with its own curvature, whatever it is: less of the waves is left behind.
            together = [*before, *_starts(alone.waves)]
            joint = fit_spherical_waves(uplink, together) if before else alone
            if _unresolved(uplink, joint.waves):
                break  # a rough wall bent one wave's front; two would describe it, and cancel
            found = joint
        except ValueError:
            break  # no maximum near the peak: a ridge, not a wave; or no second wave
        residual = replace(residual, samples=found.residual)
        remaining = float(np.sum(np.abs(residual.samples) ** 2)) - noise * residual.samples.size
        if remaining < LEAST_SHARE * energy:
            break
        this_map = angle_range_map(
            residual, aoa=first_map.aoa, path_length=first_map.path_length, centre=np.zeros(3)
        )
    if found is None:
        return NO_PATHS
    order = np.argsort([-wave.explained for wave in found.waves], kind="stable")
    keep = (3 * order[:, None] + np.arange(3)).ravel()
    free = tuple(found.waves[i] for i in order)
    share = float(np.sum(np.abs(uplink.samples) ** 2)) / energy
    step = float(uplink.frequencies[1] - uplink.frequencies[0])
    paths = tuple(
        Path(
            wave=replace(wave, covariance=wave.covariance[:2, :2]),
            free=wave,
            share=wave.explained * share,
            unambiguous=speed_of_light / step,
        )
        for wave in free
    )
    free_covariance = found.covariance[np.ix_(keep, keep)]
    lengths = (3 * np.arange(len(paths))[:, None] + np.arange(2)).ravel()
    covariance = free_covariance[np.ix_(lengths, lengths)]
    if clock_known:
        try:
            paths, covariance = _bound(uplink, paths)
        except ValueError:
            pass  # the summit with the delay's curvature lies elsewhere: keep the free one
    return PathSet(paths=paths, covariance=covariance, free_covariance=free_covariance)


def _unresolved(uplink: Uplink, waves: Sequence[SphericalWave]) -> bool:
    """Tell whether two waves are within :data:`UNRESOLVED` cells, in angle and in length."""
    beam = speed_of_light / float(uplink.frequencies.mean()) / float(np.ptp(uplink.positions[:, 0]))
    cell = speed_of_light / float(np.ptp(uplink.frequencies))
    places = np.array([[np.cos(wave.aoa) / beam, wave.path_length / cell] for wave in waves])
    apart = np.abs(places[:, None] - places).max(axis=-1)
    return bool((apart[np.triu_indices(len(waves), k=1)] < UNRESOLVED).any())


def _refined(uplink: Uplink, aoa: float, path_length: float) -> WaveStart:
    wave = fit_spherical_wave(uplink, aoa=aoa, path_length=path_length)
    start = search_curvature(uplink, aoa=wave.aoa, path_length=wave.path_length)
    return WaveStart(aoa=start.aoa, path_length=start.path_length, radius=start.radius)


def _starts(waves: Sequence[SphericalWave]) -> list[WaveStart]:
    return [
        WaveStart(aoa=wave.aoa, path_length=wave.path_length, radius=wave.radius) for wave in waves
    ]


def _bound(
    uplink: Uplink, paths: tuple[Path, ...]
) -> tuple[tuple[Path, ...], Float[np.ndarray, "bound bound"]]:
    """Fit all waves again, those whose curvature agrees with their delay with that curvature."""
    starts = [
        WaveStart(
            aoa=path.free.aoa,
            path_length=path.free.path_length,
            radius=None if path.specular else path.free.radius,
        )
        for path in paths
    ]
    fitted = fit_spherical_waves(uplink, starts)
    sizes = [2 if start.radius is None else 3 for start in starts]
    firsts = np.cumsum([0, *sizes[:-1]])
    keep = (firsts[:, None] + np.arange(2)).ravel()
    bound = tuple(
        replace(path, wave=replace(wave, covariance=wave.covariance[:2, :2]))
        for path, wave in zip(paths, fitted.waves, strict=True)
    )
    return bound, fitted.covariance[np.ix_(keep, keep)]
