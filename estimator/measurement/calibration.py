r"""Removing what the radio adds: background, cables, and its response over frequency."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, MeasurementError, Uplink

Data = TypeVar("Data", Echo, Uplink)

WEAK_DB = -60.0
"""Response below its maximum by more than this is not divided by: it would be noise. [dB]"""


def subtract_background(data: Data, background: Data) -> Data:
    """Subtract a measurement of the same array without the objects of interest.

    Parameters
    ----------
    data, background
        Measurements at the same positions and frequencies.

    Raises
    ------
    MeasurementError
        If positions or frequencies differ, or nothing remains.
    """
    for name in ("positions", "frequencies"):
        ours, theirs = getattr(data, name), getattr(background, name)
        # A micrometre and a hertz: both turn no phase by a degree.
        if ours.shape != theirs.shape or not np.allclose(ours, theirs, rtol=0, atol=1e-6):
            raise MeasurementError(
                f"background: its {name} differ from the measurement's (shapes "
                f"{theirs.shape} and {ours.shape}); measure both on the same grid"
            )
    return replace(data, samples=data.samples - background.samples)


def remove_path(data: Data, length: float, *, velocity_factor: float = 1.0) -> Data:
    r"""Take the delay of a cable or a range offset out of a measurement.

    Multiplies by :math:`e^{+j 2 \pi f l / (v c)}`, so that what stood l/v too far away comes
    to its place.

    Parameters
    ----------
    data
        Measurement whose phases include the extra path.
    length
        Length of it, over both directions in an echo. [m]
    velocity_factor
        Its speed over that of light: 1 for an offset in air, near 0.7 in a cable. [-]

    Raises
    ------
    MeasurementError
        If the length is not finite or the factor is not in (0, 1].
    """
    if not np.isfinite(length):
        raise MeasurementError(f"the path's length is {length:g} m; it must be finite")
    if not 0 < velocity_factor <= 1:
        raise MeasurementError(
            f"velocity factor {velocity_factor:g}; it must be above 0 and at most 1"
        )
    turns = data.frequencies * (length / (velocity_factor * speed_of_light))
    return replace(data, samples=data.samples * np.exp(2j * np.pi * turns))


def measured_response(
    data: Echo | Uplink, expected: Complex[np.ndarray, "positions freqs"]
) -> Complex[np.ndarray, " freqs"]:
    r"""Find the radio's response from a measurement of something known.

    The least-squares ratio of measured to expected samples over the positions,
    :math:`H_n = \sum_m e_{mn}^* s_{mn} / \sum_m |e_{mn}|^2`.

    Parameters
    ----------
    data
        Measurement of a known target or source.
    expected
        What an ideal radio would have measured there. [-]

    Raises
    ------
    MeasurementError
        If shapes disagree or the expectation vanishes at a frequency.
    """
    if expected.shape != data.samples.shape:
        raise MeasurementError(
            f"expected samples have shape {expected.shape}, measured {data.samples.shape}; "
            "they must be equal"
        )
    power = (np.abs(expected) ** 2).sum(axis=0)
    if not np.all(power > 0):
        where = float(data.frequencies[int(np.argmin(power))])
        raise MeasurementError(f"nothing is expected at {where:.6g} Hz; leave that frequency out")
    return np.asarray((expected.conj() * data.samples).sum(axis=0) / power)


def equalise(
    data: Data, response: Complex[np.ndarray, " freqs"], *, phase_only: bool = False
) -> Data:
    """Divide the radio's response over frequency out of a measurement.

    Parameters
    ----------
    data
        Measurement.
    response
        Response at its frequencies, as :func:`measured_response` gives it. [-]
    phase_only
        Leave amplitudes as they are.

    Raises
    ------
    MeasurementError
        If the shapes disagree, or the response is too weak at a frequency.
    """
    if response.shape != data.frequencies.shape:
        raise MeasurementError(
            f"response at {response.size} frequencies, measurement at {data.frequencies.size}; "
            "they must be the same"
        )
    size = np.abs(response)
    weakest = int(np.argmin(size))
    floor = 10 ** (WEAK_DB / 20) * size.max()
    if not size[weakest] > floor:
        raise MeasurementError(
            f"the response at {data.frequencies[weakest]:.6g} Hz is more than "
            f"{-WEAK_DB:g} dB below its maximum; leave that frequency out"
        )
    divisor = response / size if phase_only else response
    return replace(data, samples=data.samples / divisor)


def without_frequencies(data: Data, keep: Float[np.ndarray, "bands 2"]) -> Data:
    """Keep only the frequencies inside bands: holes are allowed everywhere afterwards.

    Parameters
    ----------
    data
        Measurement.
    keep
        First and last frequency of each band. [Hz]

    Raises
    ------
    MeasurementError
        If nothing remains.
    """
    inside = np.zeros(data.frequencies.shape, dtype=bool)
    for first, last in keep:
        inside |= (data.frequencies >= first) & (data.frequencies <= last)
    if not inside.any():
        raise MeasurementError(
            f"no frequency of {data.frequencies[0]:.6g} … {data.frequencies[-1]:.6g} Hz lies in "
            "the bands that are to be kept"
        )
    return replace(data, samples=data.samples[:, inside], frequencies=data.frequencies[inside])
