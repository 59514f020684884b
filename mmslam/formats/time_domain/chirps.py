r"""Beats of a chirp as a stepped sweep.

The beat of a delay τ with a chirp of slope K from f₀ is, over the time t since its begin,

.. math:: e^{\mp j 2 \pi [(f_0 + K t) \tau - K \tau^2 / 2]}

that is, the sweep's exp(−j2πfτ) at f = f₀ + Kt, and the residual video phase πKτ², which is taken
out at each delay (Carrara, Goodman, Majewski, "Spotlight Synthetic Aperture Radar", 1995, §2.6.2).
"""

import numpy as np
from jaxtyping import Complex, Float, Num

from mmslam.formats.tables.time_tables import ChirpTable


def chirp_frequencies(table: ChirpTable, points: int) -> Float[np.ndarray, " samples"]:
    """Return the transmitted frequency at each sample. [Hz]."""
    times = (table.adc_start_us + np.arange(points) / table.sample_rate_msps) * 1e-6
    return np.asarray(table.start_ghz * 1e9 + table.slope_mhz_per_us * 1e12 * times)


def without_residual_video_phase(
    samples: Complex[np.ndarray, "positions samples"], table: ChirpTable
) -> Complex[np.ndarray, "positions samples"]:
    """Take the residual video phase out of beats that are exp(−j2πfτ) over rising samples."""
    points = samples.shape[1]
    slope = table.slope_mhz_per_us * 1e12
    step = slope / (table.sample_rate_msps * 1e6)  # from sample to sample [Hz]
    delays = np.fft.fftfreq(points, abs(step))
    # The inverse transform gathers exp(−j2πfτ) of a rising sweep at τ; of a falling one, at −τ.
    at_delays = np.fft.ifft(samples, axis=1)
    return np.asarray(np.fft.fft(at_delays * np.exp(-1j * np.pi * slope * delays**2), axis=1))


def analytic_signal(
    samples: Num[np.ndarray, "positions points"], *, rising: bool = True
) -> Complex[np.ndarray, "positions points"]:
    """Form the analytic signal of one mixer's real samples over frequency: positive delays only.

    Parameters
    ----------
    samples
        Real part of a sweep.
    rising
        Whether the frequency rises from sample to sample.
    """
    points = samples.shape[1]
    delays = np.fft.ifft(samples.real, axis=1)
    weights = np.zeros(points)
    weights[0] = 1.0
    weights[1 : (points + 1) // 2] = 2.0
    if points % 2 == 0:
        weights[points // 2] = 1.0
    if not rising:
        weights = np.roll(weights[::-1], 1)
    return np.asarray(np.fft.fft(delays * weights, axis=1))
