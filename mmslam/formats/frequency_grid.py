"""Conversion of a sweep to the estimator's grid: rising, within the band, in equal steps."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from estimator.measurement.frequency_resampling import to_equal_steps
from estimator.measurement.model import MeasurementError, frequency_step
from mmslam.formats.mapping import SweepMapping
from mmslam.formats.plausibility import check_frequencies

ROUNDING = 0.05
"""Largest rounding of frequencies that an equal grid may replace, in steps: at the end of the
unambiguous delay, one over the step, it turns the phase by 18°; of a grid of other frequencies it
would move targets. [-]"""

NEARLY = 1e-3
"""Largest departure from equal steps, in steps, that is taken for a rounding without being told:
the phase at the end of the unambiguous delay is wrong by 2π of it, −44 dB. [-]"""


@dataclass(frozen=True, kw_only=True)
class OrderedSweep:
    """Samples over rising frequencies in equal steps."""

    samples: Complex[np.ndarray, "positions freqs"]
    frequencies: Float[np.ndarray, " freqs"]  # [Hz]
    notes: tuple[str, ...] = ()


def ordered_sweep(
    name: str,
    samples: Complex[np.ndarray, "positions points"],
    frequencies: Float[np.ndarray, " points"],
    mapping: SweepMapping,
) -> OrderedSweep:
    """Reverse falling frequencies, select the band, and resample unequal steps to equal ones.

    Parameters
    ----------
    name
        The file and table, for messages.
    samples
        In the convention exp(+jωt).
    frequencies
        Of their second axis. [Hz]
    mapping
        The band, and the rounding of the frequencies in the file.

    Raises
    ------
    MeasurementError
        If the frequencies neither rise nor fall, lie outside what radios use, or cannot be brought
        to equal steps.
    """
    unit = mapping.frequency.unit if mapping.frequency is not None else None
    remedy = f"[frequency] unit = {unit!r} may be wrong" if unit else "the file's unit may be wrong"
    if mapping.time is not None:
        remedy = f"time.band_ghz = {mapping.time.band_ghz} may be wrong"
    notes = [check_frequencies(name, frequencies, remedy)]
    if frequencies.size > 1 and np.all(np.diff(frequencies) < 0):
        samples, frequencies = samples[:, ::-1], frequencies[::-1]
        notes.append(f"{name}: the frequencies fall; they were turned, and the samples with them")
    if np.any(np.diff(frequencies) <= 0):
        raise MeasurementError(f"{name}: the frequencies do not increase; sort them")
    if mapping.band_ghz is not None:
        samples, frequencies = _band(name, samples, frequencies, mapping.band_ghz)
    try:
        if frequencies.size < 2:
            frequency_step(frequencies)
        samples, frequencies, remark = _equal(samples, frequencies, mapping)
    except MeasurementError as error:
        raise MeasurementError(f"{name}: {error}") from None
    notes.append(None if remark is None else f"{name}: {remark}")
    return OrderedSweep(
        samples=np.ascontiguousarray(samples),
        frequencies=np.ascontiguousarray(frequencies),
        notes=tuple(note for note in notes if note is not None),
    )


def _band(
    name: str,
    samples: Complex[np.ndarray, "positions points"],
    frequencies: Float[np.ndarray, " points"],
    band_ghz: list[float],
) -> tuple[Complex[np.ndarray, "positions freqs"], Float[np.ndarray, " freqs"]]:
    # Half a hertz: both numbers were written in decimals.
    low, high = 1e9 * band_ghz[0] - 0.5, 1e9 * band_ghz[1] + 0.5
    inside = (frequencies >= low) & (frequencies <= high)
    if np.count_nonzero(inside) < 2:
        raise MeasurementError(
            f"{name}: band_ghz = {band_ghz} holds {np.count_nonzero(inside)} of the frequencies "
            f"{frequencies[0] / 1e9:.6g} … {frequencies[-1] / 1e9:.6g} GHz; it needs two or more"
        )
    return samples[:, inside], frequencies[inside]


def _equal(
    samples: Complex[np.ndarray, "positions points"],
    frequencies: Float[np.ndarray, " points"],
    mapping: SweepMapping,
) -> tuple[Complex[np.ndarray, "positions freqs"], Float[np.ndarray, " freqs"], str | None]:
    even = np.linspace(frequencies[0], frequencies[-1], frequencies.size)
    away = float(np.abs(frequencies - even).max())
    step = float(even[1] - even[0])
    rounding = mapping.frequency_rounded_to_hz
    if rounding > ROUNDING * step:
        raise MeasurementError(
            f"frequency_rounded_to_hz = {rounding:g} is more than {ROUNDING:g} of the step of "
            f"{step:.6g} Hz: that is no rounding but another grid, and would move what is seen; "
            "leave it out, and unequal steps are resampled"
        )
    if away <= rounding:
        return samples, even, None
    try:
        frequency_step(frequencies)
    except MeasurementError:
        if away <= NEARLY * step:
            error_db = 20 * np.log10(2 * np.pi * away / step)
            return (
                samples,
                even,
                (
                    f"the frequency steps are not quite uniform (up to {away:.3g} Hz off) and "
                    f"taken for equal ones, with an error of at most {error_db:.0f} dB"
                ),
            )
        found = to_equal_steps(samples, frequencies)
    else:
        return samples, frequencies, None
    hint = (
        ""
        if away > ROUNDING * step
        else f"; if they were only rounded in the file, set frequency_rounded_to_hz (they are up "
        f"to {away:.3g} Hz off)"
    )
    window = tuple(1e9 * one for one in found.window)
    remark = (
        f"the frequency steps are not uniform ({np.diff(frequencies).min():.4g} … "
        f"{np.diff(frequencies).max():.4g} Hz): resampled to equal ones of {step:.6g} Hz, with an "
        f"error of {found.error_db:.0f} dB for delays of {window[0]:.3g} … {window[1]:.3g} ns; "
        f"others are lost{hint}"
    )
    return found.samples, found.frequencies, remark
