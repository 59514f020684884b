"""Conversion of arrays of any axis order, unit and number type to ours, by a mapping."""

from pathlib import Path

import numpy as np
from jaxtyping import Float, Num

from estimator.measurement.model import MeasurementError
from mmslam.formats.array_files import ArrayFiles, is_csv
from mmslam.formats.tables.frequency_table import FrequencyTable
from mmslam.formats.tables.signal_tables import SamplesTable
from mmslam.formats.tables.sources import FREQUENCY_UNITS, SourceTable
from mmslam.formats.time_domain.raw_numbers import raw_array

POSITION = "position"
GRID_AXES = ("x", "y", "z", "azimuth")
"""Names of array axes: of a list of positions, and of a scan over a grid."""

FEWEST_PHASES = 100
"""Phases from which their extent tells the unit: n phases that are spread evenly fill a part p of a
turn with the probability 1 − n pⁿ⁻¹ + (n − 1) pⁿ, that of :data:`FILLED` with 96 %; of 50, which
would be refused in the wrong unit as rarely, 28 % would be missed. [-]"""
FILLED = 0.95
"""Part of a turn that phases fill: of 100 that are spread evenly all but 4 % do. [-]"""


def array_frequencies(
    files: ArrayFiles, path: Path, table: FrequencyTable
) -> Float[np.ndarray, " freqs"]:
    """Read the frequencies, or make the grid that the mapping gives. [Hz].

    Raises
    ------
    MeasurementError
        If the variable is not one row of real numbers.
    """
    if table.start is not None and table.stop is not None and table.points is not None:
        values = np.linspace(table.start, table.stop, table.points)
    else:
        values = line_of(path, table.variable, files.array(path, table.variable))
    with np.errstate(over="ignore"):  # what overflows is refused as implausible
        return values * FREQUENCY_UNITS[table.unit]


def array_samples(
    files: ArrayFiles,
    path: Path,
    name: str,
    table: SamplesTable,
    *,
    base: Path,
    sweep: str,
    points: int | None,
) -> tuple[Num[np.ndarray, "positions points"], dict[str, int] | None]:
    """Read samples and bring their axes to positions, sweep.

    Parameters
    ----------
    files
        Where arrays are read from.
    path
        The file.
    name
        The mapping's table, for messages.
    table
        Which variables, and the order of their axes.
    base
        Folder to which file names are relative.
    sweep
        The name of the axis along which each position was measured: frequency, time or sample.
    points
        Number of samples along it; None: any.

    Returns
    -------
    The samples (complex; real ones as they are, over time and of a single mixer), and for a scan
    over a grid the length of each of its axes, in order.

    Raises
    ------
    MeasurementError
        If the axes do not fit the array, or real samples are not declared by ``analytic``.
    """
    reader = _Parts(files=files, path=path, name=name, table=table, base=base, sweep=sweep)
    values, axes = reader.samples()
    places = [axis for axis in axes if axis != sweep]
    count = values.shape[axes.index(sweep)]
    if points is not None and count != points:
        raise MeasurementError(
            f"{path}: {name} has shape {values.shape} with axes = {axes}, that is {count} "
            f"{'frequencies' if sweep == 'frequency' else f'{sweep}s'}, but there are {points}; "
            "correct axes in the mapping"
        )
    if values.dtype.kind != "c" and sweep == "frequency" and not table.analytic:
        raise MeasurementError(
            f"{path}: {name}: {table.variable or 'the array'!r} is real; give complex samples, or "
            "name real and imaginary; for the beat of a single mixer set analytic = true, and for "
            "traces over time give [time] instead of [frequency]"
        )
    ordered = values.transpose([axes.index(axis) for axis in [*places, sweep]])
    lengths = dict(zip(places, ordered.shape[:-1], strict=True))
    kind = np.complex128 if values.dtype.kind == "c" else np.float64
    flat = np.ascontiguousarray(ordered.reshape(-1, count), dtype=kind)
    return flat * table.scale, None if places in ([POSITION], []) else lengths


class _Parts:
    """The parts of samples (real, imaginary, …), each an array whose other axes are taken."""

    def __init__(
        self,
        *,
        files: ArrayFiles,
        path: Path,
        name: str,
        table: SamplesTable,
        base: Path,
        sweep: str,
    ) -> None:
        self._files, self._path, self._name = files, path, name
        self._table, self._base, self._sweep = table, base, sweep

    def samples(self) -> tuple[np.ndarray, list[str]]:
        """Return the samples and the names of their axes."""
        table, name = self._table, self._name
        offset = table.offset if isinstance(table.offset, list) else [table.offset, table.offset]
        if table.real is not None and table.imaginary is not None:
            real, axes = self._real(table.real)
            imaginary, other = self._real(table.imaginary)
            _refuse_unequal(self._path, name, real, imaginary, axes == other)
            return (real - offset[0]) + 1j * (imaginary - offset[1]), axes
        magnitude = table.magnitude or table.magnitude_db
        phase = table.phase_deg or table.phase_rad
        if magnitude is not None and phase is not None:
            size, axes = self._real(magnitude)
            turn, other = self._real(phase)
            _refuse_unequal(self._path, name, size, turn, axes == other)
            _refuse_other_unit(self._path, name, turn, degrees=table.phase_deg is not None)
            with np.errstate(over="ignore"):  # what overflows is refused as implausible
                size = 10 ** (size / 20) if table.magnitude_db else size
            return size * np.exp(1j * (np.deg2rad(turn) if table.phase_deg else turn)), axes
        values, axes = self._taken(SourceTable(variable=table.variable))
        if values.dtype.kind == "c":
            return values - complex(offset[0], offset[1]), axes
        return values - offset[0] if offset[0] else values, axes

    def _real(self, source: SourceTable) -> tuple[Float[np.ndarray, "..."], list[str]]:
        values, axes = self._taken(source)
        return real_array(self._path, source.variable, values), axes

    def _taken(self, source: SourceTable) -> tuple[np.ndarray, list[str]]:
        """Read an array and take its entry of each axis that is neither sweep nor position."""
        path = self._path if source.file is None else self._base / source.file
        name, table = self._name, self._table
        if table.raw is not None:
            values = raw_array(path, name, table.raw)
        else:
            values = self._files.array(path, source.variable, gaps=True)
        axes = self._axes(path, values, source)
        take = table.take | source.take
        _check_axes(path, name, axes, take, self._sweep)
        if values.ndim > len(axes) and np.squeeze(values).ndim == len(axes):
            values = np.squeeze(values)  # axes of length 1 need no name; MATLAB has no vectors
        if values.ndim != len(axes):
            raise MeasurementError(
                f"{path}: {name} has shape {values.shape}, but axes = {axes}; name each axis"
            )
        for axis, entry in take.items():
            at = axes.index(axis)
            if entry >= values.shape[at]:
                raise MeasurementError(
                    f"{path}: {name}.take: {axis} = {entry}, but that axis has {values.shape[at]} "
                    f"entries; choose 0…{values.shape[at] - 1}"
                )
            values = np.take(values, entry, axis=at)
            axes = [one for one in axes if one != axis]
        return values, axes

    def _axes(self, path: Path, values: np.ndarray, source: SourceTable) -> list[str]:
        if self._table.axes is not None:
            return list(self._table.axes)
        table = is_csv(path) and source.variable is not None
        if table and values.ndim == 1:  # a file of one position
            return [self._sweep]
        if values.ndim == 2 and values.shape[0] == values.shape[1] and not table:
            raise MeasurementError(
                f"{path}: {self._name} has shape {values.shape}, and either axis could be the "
                f'{self._sweep}; give axes = ["position", "{self._sweep}"] or the other way round'
            )
        return [POSITION, self._sweep]


def _check_axes(path: Path, name: str, axes: list[str], take: dict[str, int], sweep: str) -> None:
    others = [axis for axis in axes if axis not in (POSITION, sweep, *GRID_AXES)]
    scan = [axis for axis in axes if axis in GRID_AXES]
    if len(set(axes)) < len(axes) or sweep not in axes or (POSITION in axes and scan):
        raise MeasurementError(
            f'{path}: {name}.axes = {axes}; give "{sweep}", and "position" or some of "x", "y", '
            '"z" and "azimuth", each once'
        )
    if set(others) != set(take):
        raise MeasurementError(
            f"{path}: {name}.take = {take}, but the axes besides position and {sweep} are "
            f"{others}; take one entry of each of them (for I and Q along an axis, real = "
            "{ take = { iq = 0 } } and imaginary = { take = { iq = 1 } })"
        )


def line_of(path: Path, name: str | None, values: np.ndarray) -> Float[np.ndarray, " values"]:
    """Return a row of real numbers, whatever axes of length 1 are around it.

    Raises
    ------
    MeasurementError
        If it is complex, or more than one row.
    """
    numbers = np.atleast_1d(np.squeeze(real_array(path, name, values)))  # MATLAB has no vectors
    if numbers.ndim != 1:
        raise MeasurementError(
            f"{path}: {name or 'the array'!r} has shape {values.shape}; it must be one row of "
            "numbers; of a mesh of coordinates, name the grid by the samples' axes"
        )
    return numbers


def real_array(path: Path, name: str | None, values: np.ndarray) -> Float[np.ndarray, "..."]:
    """Return an array as real numbers.

    Raises
    ------
    MeasurementError
        If it is complex.
    """
    if values.dtype.kind == "c":
        raise MeasurementError(
            f"{path}: {name or 'the array'!r} is complex; real numbers are needed here"
        )
    return values.astype(np.float64)


def _refuse_other_unit(
    path: Path, name: str, phase: Float[np.ndarray, "..."], *, degrees: bool
) -> None:
    """Refuse phases that fill one turn of the other unit to its ends, and no more."""
    turn, other = (2 * np.pi, "phase_rad") if degrees else (360.0, "phase_deg")
    known = phase[np.isfinite(phase)]
    if known.size < FEWEST_PHASES:
        return
    low, high = float(known.min()), float(known.max())
    if high - low < FILLED * turn or high - low > 1.001 * turn:
        return
    if abs(low) > 1e-3 * turn and abs(low + turn / 2) > (1 - FILLED) * turn:
        return  # it neither begins at 0 nor at half a turn below
    given = "phase_deg" if degrees else "phase_rad"
    raise MeasurementError(
        f"{path}: {name}: {given} lies between {low:.4g} and {high:.4g}, which is one turn in the "
        f"other unit: name it by {other}"
    )


def _refuse_unequal(
    path: Path, name: str, one: np.ndarray, other: np.ndarray, same_axes: bool
) -> None:
    if one.shape != other.shape or not same_axes:
        raise MeasurementError(
            f"{path}: {name}: its two parts have shapes {one.shape} and {other.shape}; they must "
            "be equal"
        )
