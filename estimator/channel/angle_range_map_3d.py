"""The spherical-wave matched filter of a planar array over both direction cosines and length.

Uniform in the cosines, in which a planar array's beam is the same everywhere. Only lengths at
which the elements receive anything are worked out: the others hold no path that matters.
"""

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.planar_array import PlanarArray, planar_reach
from estimator.array.resolution import HALF_POWER
from estimator.imaging.backprojection import focus_uplink
from estimator.measurement.model import Uplink
from estimator.results.estimate import DirectionMap

SAMPLES = 1.5
"""Samples for each −3 dB width: between them a peak loses 1.3 dB at most on each axis; it is only
the start of a fit. [-]"""

PROFILE_SAMPLES = 4
"""Samples of a delay profile for each independent delay: less than 0.2 dB of a peak are lost
between them. [-]"""

SPREAD = 0.1
"""What a wave's peak in the mean profile keeps of its power at least, as it is spread over the
delays along the aperture and falls between samples. [-]"""


def direction_map(
    uplink: Uplink, array: PlanarArray, *, least_share: float, within: DirectionMap | None = None
) -> DirectionMap:
    """Match a pilot to spherical waves from every direction and path length.

    Parameters
    ----------
    uplink
        With positions in the array's frame.
    array
        Its extents.
    least_share
        Share of the energy that a path must have to be of interest. [-]
    within
        A map on whose axes to work; ``None``: all directions without grating lobes.

    Returns
    -------
    Complex map; a unit wave from a grid point peaks at 1.
    """
    if within is None:
        sine = array.unaliased(uplink.frequencies, passes=1)
        shortest = speed_of_light / float(uplink.frequencies[-1])
        along, up = (
            np.linspace(
                -sine, sine, 2 * int(np.ceil(sine * SAMPLES * d / (HALF_POWER * shortest))) + 1
            )
            for d in array.aperture
        )
        nearest, farthest = planar_reach(array, uplink, passes=1)
        band = float(uplink.frequencies[-1] - uplink.frequencies[0])
        lengths = np.arange(nearest, farthest, HALF_POWER * speed_of_light / band / SAMPLES)
    else:
        along, up, lengths = within.along, within.up, within.path_length
    busy = lengths_with_energy(uplink, lengths, array, least_share=least_share)
    ahead = 1 - along[:, None] ** 2 - up**2
    rays = np.stack(
        [
            np.broadcast_to(along[:, None], ahead.shape),
            np.sqrt(np.maximum(ahead, 0.0)),
            np.broadcast_to(up, ahead.shape),
        ],
        axis=-1,
    )
    values = np.zeros((along.size, up.size, lengths.size), dtype=np.complex128)
    if busy.any():
        # Two cosines beyond the hemisphere are no direction: their places would be out of reach.
        rays[ahead <= 0] = [0.0, 1.0, 0.0]
        points = lengths[busy][None, None, :, None] * rays[:, :, None, :]
        values[:, :, busy] = focus_uplink(uplink, points)
        values[ahead <= 0] = 0.0
    return DirectionMap(values=values, along=along, up=up, path_length=lengths, user=uplink.user)


def lengths_with_energy(
    uplink: Uplink,
    lengths: Float[np.ndarray, " ranges"],
    array: PlanarArray,
    *,
    least_share: float,
) -> np.ndarray:
    """Tell at which path lengths a wave with such a share of the energy may arrive.

    Such a wave's profile over delay, averaged over the elements, peaks at its share of the mean
    power. Along a slanted aperture the peak moves by up to the aperture's diagonal, within which
    lengths are kept, and is spread (:data:`SPREAD`).

    Parameters
    ----------
    uplink
        With positions in the array's frame.
    lengths
        Path lengths to be told apart. [m]
    array
        Its extents.
    least_share
        Share of the energy. [-]

    Returns
    -------
    Whether each length is within reach of such energy, boolean, one for each length.
    """
    window = np.hanning(uplink.frequencies.size + 2)[1:-1]
    size = PROFILE_SAMPLES * uplink.frequencies.size
    profile = np.fft.ifft(uplink.samples * (window / window.sum() * size), n=size, axis=1)
    power = np.mean(np.abs(profile) ** 2, axis=0)
    step = float(uplink.frequencies[1] - uplink.frequencies[0])
    cell = speed_of_light / (step * size)
    bright = np.flatnonzero(power > SPREAD * least_share * np.mean(np.abs(uplink.samples) ** 2))
    margin = array.half + cell
    if bright.size == 0:
        return np.zeros(lengths.size, dtype=bool)
    after = np.searchsorted(bright * cell, lengths)
    below = bright[np.maximum(after - 1, 0)] * cell
    above = bright[np.minimum(after, bright.size - 1)] * cell
    near = np.minimum(np.abs(lengths - below), np.abs(above - lengths))
    return np.asarray(near <= margin)
