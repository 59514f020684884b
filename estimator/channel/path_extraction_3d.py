"""A user's paths at a planar array: waves taken out of the pilot one after the other.

As for a linear array (:mod:`estimator.channel.path_extraction_2d`): a path that flat mirrors
reflect, or none, has the curvature of its delay; a wave that an edge or a rough patch scatters is
rounder.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.constants import speed_of_light

from estimator.array.planar_array import PlanarArray
from estimator.channel.angle_range_map_3d import direction_map
from estimator.imaging.range_gating import gated
from estimator.measurement.model import Uplink
from estimator.results.estimate import DirectionMap
from estimator.wavefronts.curvature_search_3d import WavefrontStart, search_wavefront
from estimator.wavefronts.noise_variance import noise_variance
from estimator.wavefronts.wave_fit_3d import Wavefront, fit_wavefront, wavefront_field

MOST_PATHS = 4
LEAST_SHARE = 0.05
"""Share of the pilot's energy (less the noise) below which a wave is not looked at. [-]"""
FALSE_ALARM = 1e-6
"""Probability that noise alone gives a wave somewhere in the map. [-]"""
CURVATURE_DEVIATIONS = 6.0
"""Deviations by which curvature and delay may disagree; the robust covariance is an estimate
from few tiles itself, and a rough mirror bends the wavefront in ways it only samples."""
CURVATURE_SLACK = 0.1
"""Further disagreement allowed, over the curvature; a scatterer must differ by more. [-]."""
ORDERS = (-1, 0, 1)
"""Grating lobes, along each axis, at which a wave may really have arrived."""


@dataclass(frozen=True, kw_only=True)
class SpacePath:
    """One wave of the pilot, in the array's frame."""

    wave: Wavefront  # fitted with the curvature of its delay
    free: Wavefront  # fitted with a curvature of its own
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
        nearest = min(longer, key=lambda length: abs(1 / length - self.free.curvature))
        return nearest if self._agrees_with(nearest) else None

    def _agrees_with(self, length: float) -> bool:
        deviation = float(np.sqrt(self.free.covariance[3, 3]))
        allowed = CURVATURE_DEVIATIONS * deviation + CURVATURE_SLACK / length
        return bool(abs(self.free.curvature - 1 / length) <= allowed)


def find_space_paths(
    uplink: Uplink, array: PlanarArray, first_map: DirectionMap
) -> tuple[SpacePath, ...]:
    """Take the strongest waves out of a pilot, one after the other.

    Parameters
    ----------
    uplink
        With positions in the array's frame.
    array
        Its extents.
    first_map
        Its direction map.

    Returns
    -------
    The waves in the order in which they were taken out; each holds at least
    :data:`LEAST_SHARE` of the energy.
    """
    noise = noise_variance(uplink.samples)
    energy = float(np.sum(np.abs(uplink.samples) ** 2)) - noise * uplink.samples.size
    least = noise * float(np.log(first_map.values.size / FALSE_ALARM))
    step = float(uplink.frequencies[1] - uplink.frequencies[0])
    cell = speed_of_light / float(np.ptp(uplink.frequencies))
    paths: list[SpacePath] = []
    residual, this_map = uplink, first_map
    while len(paths) < MOST_PATHS:
        power = np.abs(this_map.values) ** 2
        i, j, k = np.unravel_index(int(np.argmax(power)), power.shape)
        if power[i, j, k] * residual.samples.size < least:
            break
        length = float(this_map.path_length[k])
        near = gated(residual, length, reach=2 * array.half + 4 * cell)
        start = _best_lobe(near, array, (float(this_map.along[i]), float(this_map.up[j])), length)
        try:
            free = fit_wavefront(
                near,
                cosines=start.cosines,
                path_length=start.path_length,
                curvature=start.curvature,
            )
            wave = fit_wavefront(near, cosines=free.cosines, path_length=free.path_length)
        except ValueError:
            break  # no summit near the peak: a ridge, not a wave
        # With its own curvature, whatever it is, less of the wave is left behind.
        field = wavefront_field(residual.positions, residual.frequencies, free)
        share = float(np.vdot(field, field).real) / energy
        if share < LEAST_SHARE:
            break  # speckle
        paths.append(
            SpacePath(wave=wave, free=free, share=share, unambiguous=speed_of_light / step)
        )
        residual = replace(residual, samples=residual.samples - field)
        remaining = float(np.sum(np.abs(residual.samples) ** 2)) - noise * residual.samples.size
        if remaining < LEAST_SHARE * energy:
            break
        this_map = direction_map(residual, array, least_share=LEAST_SHARE, within=first_map)
    return tuple(paths)


def _best_lobe(
    near: Uplink, array: PlanarArray, cosines: tuple[float, float], length: float
) -> WavefrontStart:
    """Search around a peak and around where its grating lobes would come from."""
    starts = []
    wavelength = speed_of_light / float(near.frequencies.mean())
    for order in np.stack(np.meshgrid(ORDERS, ORDERS, indexing="ij"), axis=-1).reshape(-1, 2):
        lobe = np.array(cosines) + order * wavelength / np.array(array.spacing)
        if float(lobe @ lobe) < 0.95:
            starts.append(
                search_wavefront(near, cosines=(float(lobe[0]), float(lobe[1])), path_length=length)
            )
    return max(starts, key=lambda start: start.strength)
