"""A user's paths at a linear array: waves taken out of the pilot one by one, fitted together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator import false_alarm
from estimator.channel.angle_range_map_2d import angle_range_map
from estimator.channel.level_tilt import with_level_tilts
from estimator.channel.lit_elements import lit_part, shadow_of
from estimator.channel.path import (
    LEAST_SHARE,
    MOST_PATHS,
    Path,
    PathSet,
    no_paths,
)
from estimator.geometry.bearing_2d import LINEAR
from estimator.measurement.model import Uplink
from estimator.results.estimate import AngleRangeMap
from estimator.wavefronts.curvature_search_2d import search_curvature
from estimator.wavefronts.no_wave import NoWaveError
from estimator.wavefronts.noise_variance import noise_variance
from estimator.wavefronts.wave_fit_2d import (
    FittedWaves,
    SphericalWave,
    WaveStart,
    fit_spherical_wave,
    fit_spherical_waves,
)

UNRESOLVED = 0.5
"""Cells λ/D and c/B apart below which two waves are one: half the distance that Rayleigh resolves.
[-]"""


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
    least = noise * false_alarm.threshold(false_alarm.WAVE, cells=float(first_map.values.size))
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
        except NoWaveError:
            break  # no maximum near the peak: a ridge, not a wave; or no second wave
        residual = replace(residual, samples=found.residual)
        remaining = float(np.sum(np.abs(residual.samples) ** 2)) - noise * residual.samples.size
        if remaining < LEAST_SHARE * energy:
            break
        this_map = angle_range_map(
            residual, aoa=first_map.aoa, path_length=first_map.path_length, centre=np.zeros(3)
        )
    if found is None:
        return no_paths(LINEAR)
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
            shadow=shadow_of(uplink, wave.lit),
        )
        for wave in free
    )
    by_radius = found.covariance[np.ix_(keep, keep)]
    lengths = (3 * np.arange(len(paths))[:, None] + np.arange(2)).ravel()
    covariance = by_radius[np.ix_(lengths, lengths)]
    # A radius R that errs by δ is a curvature that errs by -δ/R²: that is what errs evenly.
    slopes = np.array([[1.0, 1.0, -(wave.curvature**2)] for wave in free]).ravel()
    if clock_known:
        try:
            paths, covariance = _bound(uplink, paths, free)
        except NoWaveError:
            pass  # the summit with the delay's curvature lies elsewhere: keep the free one
    found_paths = PathSet(
        paths=paths,
        covariance=covariance,
        free_covariance=by_radius * np.outer(slopes, slopes),
        how=LINEAR,
        frequency=float(uplink.frequencies.mean()),
        power=energy / uplink.samples.size,
    )
    return with_level_tilts(uplink, found_paths)


def _unresolved(uplink: Uplink, waves: Sequence[SphericalWave]) -> bool:
    """Tell whether two waves are within :data:`UNRESOLVED` cells, in angle and in length."""
    beam = speed_of_light / float(uplink.frequencies.mean()) / float(np.ptp(uplink.positions[:, 0]))
    cell = speed_of_light / float(np.ptp(uplink.frequencies))
    places = np.array([[np.cos(wave.aoa) / beam, wave.path_length / cell] for wave in waves])
    apart = np.abs(places[:, None] - places).max(axis=-1)
    return bool((apart[np.triu_indices(len(waves), k=1)] < UNRESOLVED).any())


def _refined(uplink: Uplink, aoa: float, path_length: float) -> WaveStart:
    """Refine a peak of the map on the elements that its wave reaches, from their own centre."""
    peak = path_length * LINEAR.towards(np.array([aoa]))
    reached = lit_part(uplink, peak)
    local, source = reached.pilot, peak - reached.centre
    near = float(np.linalg.norm(source))
    wave = fit_spherical_wave(local, aoa=float(np.arccos(source[0] / near)), path_length=near)
    start = search_curvature(local, aoa=wave.aoa, path_length=wave.path_length)
    seen = reached.centre + start.radius * LINEAR.towards(np.array([start.aoa]))
    radius = float(np.linalg.norm(seen))
    return WaveStart(
        aoa=float(np.arccos(seen[0] / radius)),
        path_length=start.path_length - start.radius + radius,
        radius=radius,
        lit=reached.lit,
    )


def _starts(waves: Sequence[SphericalWave]) -> list[WaveStart]:
    return [
        WaveStart(aoa=wave.aoa, path_length=wave.path_length, radius=wave.radius, lit=wave.lit)
        for wave in waves
    ]


def _bound(
    uplink: Uplink, paths: Sequence[Path], free: Sequence[SphericalWave]
) -> tuple[tuple[Path, ...], Float[np.ndarray, "bound bound"]]:
    """Fit all waves again, those whose curvature agrees with their delay with that curvature."""
    starts = [
        WaveStart(
            aoa=wave.aoa,
            path_length=wave.path_length,
            radius=None if path.specular else wave.radius,
            lit=wave.lit,
        )
        for path, wave in zip(paths, free, strict=True)
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
