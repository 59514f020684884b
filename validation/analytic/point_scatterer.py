"""Ideal points in free space, in closed form, as a reference without the simulator's code."""

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, Uplink, Waves
from simulator.receiver.impairments import complex_noise as complex_noise


def point_echo(
    targets: Float[np.ndarray, "targets 3"],
    *,
    positions: Float[np.ndarray, "positions 3"],
    frequencies: Float[np.ndarray, " freqs"],
    radar_cross_section: Float[np.ndarray, " targets"],
    phase: Float[np.ndarray, " targets"] | None = None,
    transmit_positions: Float[np.ndarray, "positions 3"] | None = None,
    waves: Waves = "spherical",
) -> Echo:
    r"""Evaluate the radar equation for points without multiple scattering.

    .. math:: S = \frac{\lambda \sqrt{\sigma}}{(4 \pi)^{3/2} R_t R_r}
              e^{-j k (R_t + R_r) + j \varphi}

    Parameters
    ----------
    targets
        Their positions. [m]
    positions
        Phase centres of the isotropic antenna. [m]
    frequencies
        [Hz]
    radar_cross_section
        Of each target. [m²]
    phase
        Of each target; ``None``: 0. [rad]
    transmit_positions
        Separate transmitters; ``None``: monostatic. [m]
    waves
        Cylindrical waves lack the spreading along z, the square root of the total length.
    """
    transmit = positions if transmit_positions is None else transmit_positions
    wavelength = speed_of_light / frequencies
    samples = np.zeros((len(positions), len(frequencies)), dtype=np.complex128)
    phases = np.zeros(len(targets)) if phase is None else phase
    for target, sigma, shift in zip(targets, radar_cross_section, phases, strict=True):
        out = np.sqrt(((target - transmit) ** 2).sum(axis=1))
        back = np.sqrt(((target - positions) ** 2).sum(axis=1))
        spread = 1 / (out * back)
        if waves == "cylindrical":
            spread = spread * np.sqrt(out + back)
        amplitude = wavelength * np.sqrt(sigma) / (4 * np.pi) ** 1.5
        turns = np.outer(out + back, 1 / wavelength)
        samples += spread[:, None] * amplitude * np.exp(-2j * np.pi * turns + 1j * shift)
    return Echo(
        samples=samples,
        positions=positions,
        frequencies=frequencies,
        transmit_positions=transmit_positions,
    )


def point_uplink(
    sources: Float[np.ndarray, "sources 3"],
    *,
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
    amplitude: Float[np.ndarray, " sources"] | None = None,
    phase: Float[np.ndarray, " sources"] | None = None,
    waves: Waves = "spherical",
    user: str = "user",
) -> Uplink:
    r"""Evaluate Friis' equation :math:`S = \lambda / (4 \pi R)\, e^{-jkR}` for each source.

    Several sources represent the images of one user in mirrors.

    Parameters
    ----------
    sources
        Their positions. [m]
    positions
        Elements. [m]
    frequencies
        [Hz]
    amplitude, phase
        Of each source, relative to an isotropic one; ``None``: 1 and 0. [-], [rad]
    waves
        Cylindrical waves lack the spreading along z, the square root of the length.
    user
        The user's name.
    """
    wavelength = speed_of_light / frequencies
    samples = np.zeros((len(positions), len(frequencies)), dtype=np.complex128)
    sizes = np.ones(len(sources)) if amplitude is None else amplitude
    phases = np.zeros(len(sources)) if phase is None else phase
    for source, size, shift in zip(sources, sizes, phases, strict=True):
        length = np.sqrt(((source - positions) ** 2).sum(axis=1))
        spread = size / (4 * np.pi * (np.sqrt(length) if waves == "cylindrical" else length))
        turns = np.outer(length, 1 / wavelength)
        samples += np.outer(spread, wavelength) * np.exp(-2j * np.pi * turns + 1j * shift)
    return Uplink(samples=samples, positions=positions, frequencies=frequencies, user=user)
