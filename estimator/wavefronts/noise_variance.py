"""The variance of the noise in a pilot, estimated from the pilot itself."""

import numpy as np
from jaxtyping import Complex


def noise_variance(samples: Complex[np.ndarray, "elements freqs"]) -> float:
    """Estimate the noise's variance in each sample, from the delays at which nothing arrives.

    The median over all delays is hardly affected by the few that hold signal; a Hann window keeps
    the signal's sidelobes out of the others.

    Parameters
    ----------
    samples
        On a uniform grid of frequencies. [-]

    Returns
    -------
    Variance of each complex sample, real and imaginary part together. [-]
    """
    window = np.hanning(samples.shape[1] + 2)[1:-1]
    delays = np.abs(np.fft.fft(samples * window, axis=1)) ** 2
    return float(np.median(delays)) / float(np.log(2)) / float(np.sum(window**2))
