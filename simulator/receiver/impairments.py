"""What a real radio adds to the noise-free samples: noise, drift and finite range.

Each impairment is one pure function of arrays and is off unless called. Whatever is random
takes its own generator, so that switching one impairment on redraws no other.
"""

import numpy as np
from jaxtyping import Complex, Float
from scipy.signal import lfilter


def complex_noise(
    shape: tuple[int, ...], variance: float, rng: np.random.Generator
) -> Complex[np.ndarray, "..."]:
    """Draw white circular Gaussian noise of a variance per complex sample.

    Parameters
    ----------
    shape
        Of the samples.
    variance
        Mean power of each. [-]
    rng
        Stream of this noise.
    """
    pair = rng.standard_normal((*shape, 2)) * np.sqrt(0.5 * variance)
    return np.asarray(pair[..., 0] + 1j * pair[..., 1])


def thermal_noise(
    samples: Complex[np.ndarray, "*n"], *, snr_db: float, rng: np.random.Generator
) -> Complex[np.ndarray, "*n"]:
    r"""Add white circular Gaussian noise at a signal-to-noise ratio.

    The ratio is the mean of :math:`|s|^2` over all samples of the array (the echo, or one
    user's uplink) over the variance of the noise in each.

    Parameters
    ----------
    samples
        Noise-free samples. [-]
    snr_db
        Signal-to-noise ratio per sample. [dB]
    rng
        Stream of this noise.

    Raises
    ------
    ValueError
        If there is no signal that the noise could be relative to.
    """
    power = float(np.mean(np.abs(samples) ** 2)) if samples.size else 0.0
    if not (np.isfinite(power) and power > 0):
        raise ValueError(
            f"the noise is set to {snr_db} dB below the signal, but the signal's mean power is "
            f"{power}: nothing reaches the antennas; open a path or remove the noise"
        )
    noise = complex_noise(samples.shape, power / 10 ** (snr_db / 10), rng)
    return np.asarray(samples + noise)


def phase_noise(
    samples: Complex[np.ndarray, "*n freqs"],
    *,
    rms: float,
    correlation: float = 0.0,
    rng: np.random.Generator,
) -> Complex[np.ndarray, "*n freqs"]:
    r"""Multiply by :math:`e^{j\varphi}` with a stationary Gaussian phase over the sweeps.

    The samples are taken in the order of time: sweep by sweep, frequency by frequency. The
    phase is a first-order Markov process, so a correlation over a few samples is the
    synthesiser's close-in noise, one over many sweeps is slow thermal drift.

    Parameters
    ----------
    samples
        One row per sweep. [-]
    rms
        Standard deviation of the phase. [rad]
    correlation
        Samples after which the correlation has fallen to 1/e; 0 for white noise. [samples]
    rng
        Stream of this noise.
    """
    white = rng.standard_normal(samples.size)
    memory = float(np.exp(-1.0 / correlation)) if correlation > 0 else 0.0
    innovation = np.sqrt(1.0 - memory**2)
    # The filter starts in its stationary state: the first sample has the full variance too.
    start = (1.0 - innovation) * white[:1]
    phase = lfilter([innovation], [1.0, -memory], white, zi=start)[0]
    turned: np.ndarray = samples * np.exp(1j * rms * phase.reshape(samples.shape))
    return turned


def gain_ripple(
    samples: Complex[np.ndarray, "*n freqs"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    peak_db: float,
    period: float,
    rng: np.random.Generator,
) -> Complex[np.ndarray, "*n freqs"]:
    r"""Multiply by the standing wave of a mismatched line, the same in every sweep.

    .. math:: G(f) = 1 + \rho \, e^{-j (2 \pi f / F + \varphi)}, \qquad
              \rho = 10^{\mathrm{peak}/20} - 1

    A second pass through the line: it ripples over frequency with the period :math:`F` and
    makes a fainter copy of everything, later by :math:`1/F`. The phase :math:`\varphi` is drawn.

    Parameters
    ----------
    samples
        Samples over frequency. [-]
    frequencies
        Frequency grid. [Hz]
    peak_db
        How far the gain rises at a crest. [dB]
    period
        :math:`F`, the reciprocal of the round-trip delay of the line. [Hz]
    rng
        Stream of the phase.
    """
    reflected = 10.0 ** (peak_db / 20.0) - 1.0
    phase = 2.0 * np.pi * frequencies / period + rng.uniform(0.0, 2.0 * np.pi)
    rippled: np.ndarray = samples * (1.0 + reflected * np.exp(-1j * phase))
    return rippled


def position_jitter(
    positions: Float[np.ndarray, "positions 3"],
    *,
    rms: float,
    dimensions: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, "positions 3"]:
    """Positions where the antennas truly stood, when the measurement says they stood here.

    Parameters
    ----------
    positions
        Nominal phase centres, those that the measurement reports. [m]
    rms
        Standard deviation along each axis. [m]
    dimensions
        2: the antennas stay in their plane of z; 3: they move along z too.
    rng
        Stream of this jitter.
    """
    # Drawn along all three axes: the same seed moves x and y alike in two and in three dimensions.
    jitter = rms * rng.standard_normal(positions.shape)
    jitter[:, dimensions:] = 0.0
    return positions + jitter


def clock_offset(
    samples: Complex[np.ndarray, "*n freqs"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    offset: float,
) -> Complex[np.ndarray, "*n freqs"]:
    r"""Shift all delays as a user's clock that is ahead does: :math:`s \, e^{+j 2 \pi f \delta}`.

    The user sends at zero of its clock. If that is ahead by :math:`\delta`, the pilot leaves
    :math:`\delta` too early and a path of delay :math:`\tau` seems to take :math:`\tau - \delta`.

    Parameters
    ----------
    samples
        Uplink samples over frequency. [-]
    frequencies
        Frequency grid. [Hz]
    offset
        The user's clock minus the base station's. [s]
    """
    return samples * np.exp(2j * np.pi * frequencies * offset)


def limited_dynamic_range(
    samples: Complex[np.ndarray, "*n"], *, dynamic_range_db: float
) -> Complex[np.ndarray, "*n"]:
    r"""Quantise both components, full scale at the strongest sample.

    The step :math:`\Delta = \sqrt{6} \, |s|_\max \, 10^{-\mathrm{DR}/20}` puts the mean power
    of the rounding error, :math:`2 \Delta^2 / 12`, the dynamic range below the strongest
    sample. What stays below half a step is lost, unless noise lifts it: apply it last.

    Parameters
    ----------
    samples
        Samples as they reach the converter, noise included. [-]
    dynamic_range_db
        Strongest sample over the rounding error. [dB]
    """
    full_scale = float(np.max(np.abs(samples), initial=0.0))
    if full_scale == 0.0:
        return samples.copy()
    step = np.sqrt(6.0) * full_scale * 10.0 ** (-dynamic_range_db / 20.0)
    rounded: np.ndarray = np.round(samples.real / step) + 1j * np.round(samples.imag / step)
    rounded *= step
    return rounded
