"""The part of an array that a wave reaches: an edge before the source may shadow the rest.

An obstacle whose edge is before a user shadows a part of the aperture. A single spherical wave that
is fitted to all of it has its angle and curvature from where the shadow begins, or is taken for
two waves. So the samples of each element are matched to the wave in amplitude alone, whose phases
need not be known to a part of a wavelength, and the wave is fitted to the elements that it reaches.
The fringes beside the edge of a shadow are not modelled: they bend what is left of the front, and a
wave that they bend much is no mirror-like one (:attr:`estimator.channel.path.Path.specular`).
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool
from scipy.ndimage import label, median_filter

from estimator.measurement.model import Uplink
from estimator.wavefronts.noise_variance import noise_variance
from estimator.wavefronts.wave_model_2d import wave_field

DARK = 0.06
"""Power at an element, over the greatest, below which the wave does not reach it. A quarter of the
amplitude: half of what a knife edge leaves on the boundary of its shadow. [-]"""
DARK_REST = 0.04
"""Largest mean power of the elements that the wave does not reach, over that of the others. Fronts
that roughness bends, or two waves in one cell, fade at many places and nowhere for long. [-]"""
FADES = 5
"""Elements over whose median the power is taken: single ones may fade. [-]"""
FEWEST = 12
"""Fewest elements that a wave is fitted to: as many as tell its three parameters with four to each.
[-]"""
LEAST_SHADOW = 0.05
"""Share of the elements in the shadow from which it counts: less moves nothing by more than the
noise does. [-]"""


def lit_elements(
    uplink: Uplink, *, aoa: float, path_length: float
) -> Bool[np.ndarray, " elements"] | None:
    """Tell which elements of a line a wave reaches.

    Parameters
    ----------
    uplink
        With positions in the array's frame, in order along the array.
    aoa, path_length
        Of the wave, to a part of a cell. [rad], [m]

    Returns
    -------
    One run of elements; ``None`` if all, or if it is not one run that it reaches.
    """
    count, freqs = uplink.samples.shape
    unit = wave_field(
        uplink.positions, uplink.frequencies, aoa=aoa, path_length=path_length, radius=path_length
    )
    amplitude = np.abs(np.einsum("mn,mn->m", unit.conj(), uplink.samples))
    amplitude /= np.einsum("mn,mn->m", unit.conj(), unit).real
    power = np.maximum(amplitude**2 - noise_variance(uplink.samples) / freqs, 0.0)
    smooth = median_filter(power, size=min(FADES, count), mode="nearest")
    reached, runs = label(smooth > DARK * smooth.max())
    if not runs:
        return None
    lit: np.ndarray = reached == 1 + int(
        np.argmax([power[reached == run].sum() for run in range(1, runs + 1)])
    )
    shadow = count - int(lit.sum())
    if shadow < LEAST_SHADOW * count or lit.sum() < FEWEST:
        return None
    if power[~lit].mean() > DARK_REST * power[lit].mean():
        return None
    return lit


def part_of(uplink: Uplink, lit: Bool[np.ndarray, " elements"] | None) -> Uplink:
    """Return what some elements received.

    Parameters
    ----------
    uplink
        The pilot.
    lit
        The elements; ``None``: all.
    """
    if lit is None:
        return uplink
    return replace(uplink, samples=uplink.samples[lit], positions=uplink.positions[lit])
