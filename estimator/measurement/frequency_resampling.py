r"""A sweep at unequal frequencies, brought to equal steps.

The samples are a sum of exp(−j2πfτ) over the delays of a window of length T. Of all such sums,
equally likely at every delay, the best linear estimate at other frequencies is

.. math:: s(f_u) = K(f_u, f) [K(f, f) + \epsilon I]^{-1} s(f), \qquad
          K(f, f') = \operatorname{sinc}[(f - f') T] \, e^{-j 2 \pi (f - f') \tau_c}

(Gaussian-process, or band-limited, interpolation: J. L. Yen, "On nonuniform sampling of
bandwidth-limited signals", IRE Trans. Circuit Theory 3(4), 1956, doi:10.1109/TCT.1956.1086325).
Its error over that window is known beforehand; it is small as long as the largest step is below 1/T
(K. Gröchenig, "Reconstruction algorithms in irregular sampling", Math. Comp. 59, 1992).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from jaxtyping import Complex, Float

from estimator.measurement.model import MeasurementError

WINDOW = 0.8
"""Length of the window of delays, over one divided by the largest step: at 1 the error at the ends
of the sweep grows without bound (Gröchenig's limit). [-]"""

REGULAR = 1e-7
"""ε, over the signal's power in a sample: an error of −70 dB, and noise is not amplified. [-]"""

LARGEST_ERROR_DB = -40.0
"""Largest error that is accepted, over the delays of the window: a false echo 40 dB below. [dB]"""

MOST_POINTS = 2048
"""Of a sweep; the work is the cube of it. [-]"""


@dataclass(frozen=True, kw_only=True)
class EqualSteps:
    """A sweep at equal steps, and what became of it."""

    samples: Complex[np.ndarray, "positions freqs"]
    frequencies: Float[np.ndarray, " freqs"]  # [Hz]
    error_db: float  # of unit echoes over the window of delays, root mean square
    window: tuple[float, float]  # the delays that are kept [s]


def to_equal_steps(
    samples: Complex[np.ndarray, "positions points"], frequencies: Float[np.ndarray, " points"]
) -> EqualSteps:
    """Resample a sweep at unequal, rising frequencies to as many equal steps.

    Parameters
    ----------
    samples
        A delay τ appears as exp(−j2πfτ).
    frequencies
        Rising. [Hz]

    Raises
    ------
    MeasurementError
        If there are too many points, or the steps are too unequal for the error that is accepted.
    """
    count = frequencies.size
    if count > MOST_POINTS:
        raise MeasurementError(
            f"frequency: {count} unequal steps; at most {MOST_POINTS} are brought to equal ones: "
            "choose a part of them by band_ghz"
        )
    window = _window(samples, frequencies)
    even = np.linspace(frequencies[0], frequencies[-1], count)
    length, centre = window[1] - window[0], sum(window) / 2
    # Relative to the window's centre the kernel is real, and the middle keeps numbers small.
    middle = (frequencies[0] + frequencies[-1]) / 2
    gram = np.sinc((frequencies[:, None] - frequencies) * length)
    cross = np.sinc((even[:, None] - frequencies) * length)
    factor = scipy.linalg.cho_factor(gram + REGULAR * np.eye(count))
    weights = scipy.linalg.cho_solve(factor, cross.T).T
    error = 1 - 2 * (weights * cross).sum(axis=1) + ((weights @ gram) * weights).sum(axis=1)
    error_db = 5 * float(np.log10(max(float(np.mean(error**2)), 1e-30)))
    if error_db > LARGEST_ERROR_DB:
        raise MeasurementError(
            f"frequency: the steps are so unequal that echoes at equal ones would be known to "
            f"{error_db:.0f} dB only (limit {LARGEST_ERROR_DB:g} dB); choose a part of the sweep "
            "with smaller gaps by band_ghz"
        )
    centred = samples * np.exp(2j * np.pi * (frequencies - middle) * centre)
    return EqualSteps(
        samples=(centred @ weights.T) * np.exp(-2j * np.pi * (even - middle) * centre),
        frequencies=even,
        error_db=error_db,
        window=window,
    )


def _window(
    samples: Complex[np.ndarray, "positions points"], frequencies: Float[np.ndarray, " points"]
) -> tuple[float, float]:
    """Choose the delays that are kept: from 0, unless another window holds more of the power."""
    length = WINDOW / float(np.diff(frequencies).max())
    delays = np.linspace(-length, 2 * length, 4 * frequencies.size)
    # Some positions tell as much of the delays as all.
    some = samples[:: max(1, len(samples) // 16)]
    weights = np.gradient(frequencies)  # each sample stands for its part of the band
    offsets = frequencies - frequencies[0]
    spectrum = (some * weights) @ np.exp(2j * np.pi * offsets[:, None] * delays)
    power = (np.abs(spectrum) ** 2).sum(axis=0)
    total = np.concatenate([[0.0], np.cumsum(power)])
    wide = int(np.searchsorted(delays, delays[0] + length))
    held = total[wide:] - total[:-wide]
    first = int(np.searchsorted(delays, 0.0))
    best = int(np.argmax(held))
    # A twentieth: side lobes and noise spread that much between windows.
    begin = 0.0 if held[first] > 0.95 * held[best] else float(delays[best])
    return begin, begin + length
