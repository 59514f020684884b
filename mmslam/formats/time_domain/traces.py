r"""Traces over time as a stepped sweep, by Fourier transform over a band.

.. math:: S(f) = \sum_n s(t_n) e^{-j 2 \pi f (t_n - t_0)}

so that a delay τ after the pulse's departure t₀ appears as exp(−j2πfτ), as it does in a sweep.
The pulse's own spectrum stays in; it is divided out by a `response`, or left as a weight.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float, Num

from estimator.measurement.model import MeasurementError
from mmslam.formats.array_files import ArrayFiles, format_of
from mmslam.formats.hdf5_files import hdf5_attribute
from mmslam.formats.mapped_arrays import line_of
from mmslam.formats.tables.sources import TIME_UNITS
from mmslam.formats.tables.time_tables import TimeTable
from mmslam.formats.time_domain.gssi_files import read_dzt

UNEQUAL_STEP = 1e-3
"""Largest departure of a sample from equal steps, in steps: at a quarter of the sampling frequency
it turns the phase by 0.09°. [-]"""

WEAK_BAND_DB = -40.0
"""A part of the band this far below its strongest holds no pulse, only noise. [dB]"""


@dataclass(frozen=True, kw_only=True)
class TraceTimes:
    """When the samples of each trace were taken: equal steps from a first one."""

    first: float  # after the pulse left the antenna [s]
    step: float  # [s]
    points: int | None  # None: as many as there are


def trace_times(files: ArrayFiles, path: Path, table: TimeTable) -> TraceTimes:
    """Read the times of the samples, from a variable, the mapping, or the file's own header.

    Raises
    ------
    MeasurementError
        If the steps are unequal, or nothing tells them.
    """
    unit = TIME_UNITS[table.unit]
    if table.is_named():
        times = line_of(path, table.variable, files.array(path, table.variable)) / unit
        if times.size < 2 or not times[1] > times[0]:
            raise MeasurementError(f"{path}: {table.variable!r}: the times must rise; sort them")
        step = float(times[-1] - times[0]) / (times.size - 1)
        worst = float(np.abs(times - times[0] - step * np.arange(times.size)).max())
        if worst > UNEQUAL_STEP * step:
            raise MeasurementError(
                f"{path}: {table.variable!r}: the steps of time are unequal (by {worst / step:.3g} "
                "of a step); resample the traces to equal ones"
            )
        return TraceTimes(first=float(times[0]) - table.zero / unit, step=step, points=times.size)
    if table.step is not None:
        first = (table.first - table.zero) / unit
        return TraceTimes(first=first, step=table.step / unit, points=None)
    kind = format_of(path)
    if kind == "dzt":
        header = read_dzt(path)
        first = header.first_time + (table.first - table.zero) / unit
        return TraceTimes(first=first, step=header.time_step, points=header.traces.shape[-1])
    if kind == "hdf5":
        step = _time_step(path)
        return TraceTimes(first=(table.first - table.zero) / unit, step=step, points=None)
    raise MeasurementError(
        f"{path}: nothing tells the times; give time.variable, or time.step in {table.unit}"
    )


def spectrum_of_traces(
    name: str,
    traces: Num[np.ndarray, "positions times"],
    times: TraceTimes,
    table: TimeTable,
) -> tuple[Complex[np.ndarray, "positions freqs"], Float[np.ndarray, " freqs"], tuple[str, ...]]:
    """Bring traces to a stepped sweep over the band.

    Parameters
    ----------
    name
        The mapping's table, for messages.
    traces
        Real samples, or complex ones about a carrier.
    times
        When they were taken.
    table
        The band and the carrier.

    Returns
    -------
    Samples; frequencies at the steps of the trace's own length [Hz]; and remarks.

    Raises
    ------
    MeasurementError
        If the band is not within what the sampling tells, or holds fewer than two frequencies.
    """
    count = traces.shape[1]
    real = traces.dtype.kind != "c"
    if real and table.carrier_ghz != 0:
        raise MeasurementError(
            f"{name}: time.carrier_ghz = {table.carrier_ghz:g}, but the traces are real: give "
            "complex ones (real and imaginary), or leave the carrier out"
        )
    offsets = np.fft.rfftfreq(count, times.step) if real else np.fft.fftfreq(count, times.step)
    frequencies = table.carrier_ghz * 1e9 + offsets
    low, high = (1e9 * one for one in table.band_ghz)
    reach = (float(frequencies.min()), float(frequencies.max()))
    slack = 0.5 / (count * times.step)
    if low < reach[0] - slack or high > reach[1] + slack:
        raise MeasurementError(
            f"{name}: time.band_ghz = {table.band_ghz}, but samples {1e12 * times.step:.4g} ps "
            f"apart tell frequencies of {reach[0] / 1e9:.4g} … {reach[1] / 1e9:.4g} GHz; choose a "
            "band within these, or correct time.step and time.unit"
        )
    # Half a hertz: the band's ends are numbers of a file, the bins are computed.
    kept = np.flatnonzero((frequencies >= low - 0.5) & (frequencies <= high + 0.5))
    kept = kept[np.argsort(frequencies[kept])]
    if kept.size < 2:
        raise MeasurementError(
            f"{name}: time.band_ghz = {table.band_ghz} holds {kept.size} of the frequencies, "
            f"{1e-9 / (count * times.step):.4g} GHz apart (one over the trace's length); widen it"
        )
    transform = np.fft.rfft(traces, axis=1) if real else np.fft.fft(traces, axis=1)
    chosen = frequencies[kept]
    # What was mixed down keeps the carrier's phase; the delay of the first sample turns the rest.
    samples = transform[:, kept] * np.exp(-2j * np.pi * (chosen if real else offsets[kept])
                                          * times.first)  # fmt: skip
    return samples, chosen, _band_note(name, samples, chosen)


def _band_note(
    name: str,
    samples: Complex[np.ndarray, "positions freqs"],
    frequencies: Float[np.ndarray, " freqs"],
) -> tuple[str, ...]:
    power = (np.abs(samples) ** 2).mean(axis=0)
    strong = np.flatnonzero(power >= 10 ** (WEAK_BAND_DB / 10) * power.max())
    if strong.size == power.size:
        return ()
    low, high = frequencies[strong[0]] / 1e9, frequencies[strong[-1]] / 1e9
    return (
        f"{name}: parts of time.band_ghz are more than {-WEAK_BAND_DB:g} dB below its strongest: "
        f"the pulse's power lies in {low:.4g} … {high:.4g} GHz",
    )


def _time_step(path: Path) -> float:
    found = hdf5_attribute(path, "dt")
    if found is None or not 0 < found < np.inf:
        raise MeasurementError(
            f"{path}: has no attribute 'dt' of the time step (gprMax writes it); give "
            "time.variable or time.step"
        )
    return found
