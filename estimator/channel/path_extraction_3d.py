"""A user's paths at a planar array: waves taken out of the pilot one after the other.

As for a linear array (:mod:`estimator.channel.path_extraction_2d`): a path that flat mirrors
reflect, or none, has the curvature of its delay; a wave that an edge or a rough patch scatters is
rounder.
"""

from dataclasses import replace

import numpy as np
from scipy.constants import speed_of_light
from scipy.linalg import block_diag

from estimator import false_alarm
from estimator.array.planar_array import PlanarArray
from estimator.channel.angle_range_map_3d import direction_map
from estimator.channel.level_tilt import with_level_tilts
from estimator.channel.lit_elements import LitPart, lit_part, shadow_of
from estimator.channel.path import LEAST_SHARE, MOST_PATHS, Path, PathSet
from estimator.geometry.bearing_3d import PLANAR
from estimator.imaging.range_gating import gated
from estimator.measurement.model import Uplink
from estimator.results.estimate import DirectionMap
from estimator.wavefronts.curvature_search_3d import WavefrontStart, search_wavefront
from estimator.wavefronts.no_wave import NoWaveError
from estimator.wavefronts.noise_variance import noise_variance
from estimator.wavefronts.wave_fit_3d import (
    Wavefront,
    about_another_centre,
    fit_wavefront,
    wavefront_field,
)

WIDEST = 0.95
"""Largest sum of squared cosines of a grating lobe that is tried: 13° from the array's plane.
[-]"""
ORDERS = (-1, 0, 1)
"""Grating lobes, along each axis, at which a wave may really have arrived: at up to λ
apart no other lies in front of the array. [-]"""
GATE_CELLS = 4.0
"""Range beyond the array's extent that is kept for the fit of a wave: its main lobe, and what the
map's peak is off. As for walls (:mod:`estimator.walls.wall_detection_3d`). [cells c/B]"""


def find_space_paths(
    uplink: Uplink, array: PlanarArray, first_map: DirectionMap, *, clock_known: bool = True
) -> PathSet:
    """Take the strongest waves out of a pilot, one after the other.

    Parameters
    ----------
    uplink
        With positions in the array's frame.
    array
        Its extents.
    first_map
        Its direction map.
    clock_known
        Whether a delay is a length; if not, no curvature is taken from it.

    Returns
    -------
    The waves, strongest first; each holds at least :data:`LEAST_SHARE` of the energy. Each is
    fitted by itself in a gate of delays, so that the errors of different ones are taken to be
    independent.
    """
    noise = noise_variance(uplink.samples)
    energy = float(np.sum(np.abs(uplink.samples) ** 2)) - noise * uplink.samples.size
    least = noise * false_alarm.threshold(false_alarm.WAVE, cells=float(first_map.values.size))
    step = float(uplink.frequencies[1] - uplink.frequencies[0])
    cell = speed_of_light / float(np.ptp(uplink.frequencies))
    paths: list[Path] = []
    residual, this_map = uplink, first_map
    while len(paths) < MOST_PATHS:
        power = np.abs(this_map.values) ** 2
        i, j, k = np.unravel_index(int(np.argmax(power)), power.shape)
        if power[i, j, k] * residual.samples.size < least:
            break
        length = float(this_map.path_length[k])
        near = gated(residual, length, reach=2 * array.half + GATE_CELLS * cell)
        cosines = float(this_map.along[i]), float(this_map.up[j])
        try:
            free, reached = _fitted(near, array, cosines, length)
        except NoWaveError:
            break  # no summit near the peak: a ridge, not a wave
        # With its own curvature, whatever it is, less of the wave is left behind.
        field = wavefront_field(residual.positions, residual.frequencies, free)
        if reached.lit is not None:
            field[~reached.lit] = 0.0
        share = float(np.vdot(field, field).real) / energy
        if share < LEAST_SHARE:
            break  # speckle
        path = Path(
            wave=replace(free, covariance=free.covariance[:3, :3]),
            free=free,
            share=share,
            unambiguous=speed_of_light / step,
            shadow=shadow_of(uplink, reached.lit),
        )
        paths.append(_bound(reached, path) if clock_known and path.specular else path)
        residual = replace(residual, samples=residual.samples - field)
        remaining = float(np.sum(np.abs(residual.samples) ** 2)) - noise * residual.samples.size
        if remaining < LEAST_SHARE * energy:
            break
        this_map = direction_map(residual, array, least_share=LEAST_SHARE, within=first_map)
    paths.sort(key=lambda path: -path.share)
    nothing = np.zeros((0, 0))
    found_paths = PathSet(
        paths=tuple(paths),
        covariance=block_diag(nothing, *(path.wave.covariance for path in paths)),
        free_covariance=block_diag(nothing, *(path.free.covariance for path in paths)),
        how=PLANAR,
        frequency=float(uplink.frequencies.mean()),
        power=energy / uplink.samples.size,
    )
    return with_level_tilts(uplink, found_paths)


def _fitted(
    near: Uplink, array: PlanarArray, cosines: tuple[float, float], length: float
) -> tuple[Wavefront, LitPart]:
    """Fit a wave with a curvature of its own, from the centre of the elements that it reaches."""
    peak = length * PLANAR.towards(np.array(cosines))
    reached = lit_part(near, peak)
    if reached.lit is not None:
        source = peak - reached.centre
        length = float(np.linalg.norm(source))
        cosines = float(source[0]) / length, float(source[2]) / length
    start = _best_lobe(reached.pilot, array, cosines, length)
    free = fit_wavefront(
        reached.pilot,
        cosines=start.cosines,
        path_length=start.path_length,
        curvature=start.curvature,
    )
    if reached.lit is not None:
        free = about_another_centre(free, -reached.centre)
    return free, reached


def _bound(reached: LitPart, path: Path) -> Path:
    """Fit a wave again with the curvature of its delay."""
    free = path.free
    assert isinstance(free, Wavefront)
    if reached.lit is not None:
        free = about_another_centre(free, reached.centre)
    try:
        wave = fit_wavefront(reached.pilot, cosines=free.cosines, path_length=free.path_length)
    except NoWaveError:
        return path  # the summit with the delay's curvature lies elsewhere: keep the free one
    if reached.lit is not None:
        wave = about_another_centre(wave, -reached.centre)
    return replace(path, wave=wave)


def _best_lobe(
    near: Uplink, array: PlanarArray, cosines: tuple[float, float], length: float
) -> WavefrontStart:
    """Search around a peak and around where its grating lobes would come from."""
    starts = []
    wavelength = speed_of_light / float(near.frequencies.mean())
    for order in np.stack(np.meshgrid(ORDERS, ORDERS, indexing="ij"), axis=-1).reshape(-1, 2):
        lobe = np.array(cosines) + order * wavelength / np.array(array.spacing)
        if float(lobe @ lobe) < WIDEST:
            starts.append(
                search_wavefront(near, cosines=(float(lobe[0]), float(lobe[1])), path_length=length)
            )
    return max(starts, key=lambda start: start.strength)
