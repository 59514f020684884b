r"""The phase error of a measured wavefront against a sphere, estimated from the fit's residual.

Noise is white; the error that a rough mirror adds is not. A patch of the mirror beside the specular
point contributes a wave from another angle, hence a fringe of some period over the aperture, with
an excess delay that grows with the square of that angle. In cosine modes (p over the aperture, q
over the band) it lies along a parabola q ∝ p²; summed over q its power is nearly the same for all
p, as the roughness' spectrum is flat up to one over the correlation length. The power of modes in
the residual therefore gives that of modes that the fit absorbs: in the mean over the band (q = 0)
p = 3 … 8 give the level of a tilt (p = 1), in the first mode over the band (q = 1) p = 1 … 3 that
of a delay (p = 0).

A patch within a Fresnel zone of the specular point changes the phase only; farther out half of its
power changes the amplitude. The power of a slow phase error is therefore the sum of both.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.fft import dct

from estimator import false_alarm
from estimator.compute.distributions import chi_square_quantile, f_quantile

TILTS = (3, 8)
"""Modes over the aperture, in half periods, that tell the level of a tilt. Lower ones belong to
the wave itself (gain, angle, curvature) and to the antenna's beam; far higher ones come from
patches so late or so far off that the fit does not see them."""
DELAYS = (1, 3)
"""Modes over the aperture that tell, in the first mode over the band, the level of a delay."""

TILT_SHARE, DELAY_SHARE = 0.8, 0.5
"""Variance of a tilt and of a delay over the level that these modes tell. From 56 realisations of
four walls (20 to 40 cm, 0.01 to 0.1 mm rms, 30 and 75 GHz): 0.6 to 1.0, and 0.2 to 0.55; lowest
where the wall is longest, as its far patches come too late to touch the first mode."""

MANY = 40
"""Last mode that tells whether there is anything beside noise at all. [half periods]"""
COVERED = 0.95
"""Probability of the region that stays one when a variance is known from few modes only. [-]"""


@dataclass(frozen=True, kw_only=True)
class WavefrontError:
    """Variance of a wave's phase on top of the noise, independent from element to element."""

    mean: float  # common to all frequencies [rad²]
    slope: float  # along half a cosine over the band, of mean square 1 [rad²]


def wavefront_error(
    residual: Complex[np.ndarray, "elements freqs"],
    wave: Complex[np.ndarray, "elements freqs"],
    noise: float,
) -> WavefrontError:
    """Estimate the error of a fitted wave's phase from the residual of the fit.

    Parameters
    ----------
    residual
        The pilot less all fitted waves. [-]
    wave
        One of these, as it was fitted. [-]
    noise
        Variance of each sample. [-]

    Returns
    -------
    Its variances; 0 where noise alone explains the residual.
    """
    count = wave.shape[1]
    size = np.abs(wave)
    level = float(np.sqrt(np.mean(size**2)))
    turned = residual * np.conj(wave) / (np.maximum(size, 1e-12 * level) * level)
    falling = np.sqrt(2) * np.cos(np.pi * (np.arange(count) + 0.5) / count)
    bands = np.stack([turned.mean(axis=1), (turned * falling).mean(axis=1)])
    # Antennas' gain and the wave's spreading vary over the band by a factor common to all
    # elements: it is no curvature of the wavefront, though near elements receive more.
    shape = size[:, 0] / np.linalg.norm(size[:, 0])
    bands = bands - np.outer(bands @ shape, shape)
    modes = np.abs(dct(bands.real, norm="ortho", axis=1)) ** 2
    modes += np.abs(dct(bands.imag, norm="ortho", axis=1)) ** 2
    white = noise / level**2 / count
    tilts, delays = (
        _excess(row, first, last, white)
        for row, (first, last) in zip(modes, (TILTS, DELAYS), strict=True)
    )
    return WavefrontError(mean=TILT_SHARE * tilts, slope=DELAY_SHARE * delays)


def _excess(modes: Float[np.ndarray, " elements"], first: int, last: int, white: float) -> float:
    """Return the mean level of modes ``first`` to ``last``, less that of noise.

    Where these are not significant (:data:`estimator.false_alarm.EXCESS`), the mean of modes up to
    :data:`MANY` is used, which knows the level of a weak error better.
    """
    first = min(first, modes.size - 1)
    few = modes[first : last + 1]
    if few.mean() > white * chi_square_quantile(1 - false_alarm.EXCESS, 2 * few.size) / (
        2 * few.size
    ):
        return _widening((first, last)) * (float(few.mean()) - white)
    return max(float(modes[first : MANY + 1].mean()) - white, 0.0)


def _widening(modes: tuple[int, int]) -> float:
    """Return a factor on a variance known from few modes, for a true 95 % region in the plane.

    The square of an error over such a variance is F-distributed, with two degrees of freedom for
    each mode, not χ².
    """
    freedom = 2 * (modes[1] - modes[0] + 1)
    return 2 * f_quantile(COVERED, 2, freedom) / chi_square_quantile(COVERED, 2)
