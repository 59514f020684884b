"""Arrays of any axis order and unit, as a mapping tells them, brought to ours."""

from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float

from estimator.measurement.model import MeasurementError
from mmslam.formats.array_files import ArrayFiles, is_csv
from mmslam.formats.mapping import (
    FREQUENCY,
    FREQUENCY_UNITS,
    GRID_AXES,
    LENGTH_UNITS,
    POSITION,
    FrequencyTable,
    PositionTable,
    SamplesTable,
)


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
        values = _line(path, table.variable, files.array(path, table.variable))
    with np.errstate(over="ignore"):  # what overflows is refused as implausible
        return values * FREQUENCY_UNITS[table.unit]


def array_samples(
    files: ArrayFiles, path: Path, name: str, table: SamplesTable, points: int
) -> tuple[Complex[np.ndarray, "positions freqs"], dict[str, int] | None]:
    """Read complex samples and bring their axes to positions, frequencies.

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
    points
        Number of frequencies.

    Returns
    -------
    The samples, and for a scan over a grid the length of each of its axes, in order.

    Raises
    ------
    MeasurementError
        If the axes do not fit the array.
    """
    values = _complex(files, path, name, table)
    axes = table.axes
    if axes is None:
        axes = [POSITION, FREQUENCY]
        if values.ndim == 2 and values.shape[0] == values.shape[1] and not is_csv(path):
            raise MeasurementError(
                f"{path}: {name} has shape {values.shape}, and either axis could be the "
                'frequency; give axes = ["position", "frequency"] or the other way round'
            )
    _check_axes(path, name, axes, table)
    if values.ndim != len(axes) and axes == [FREQUENCY]:
        values = np.squeeze(values)  # MATLAB has no vectors
    if values.ndim != len(axes):
        raise MeasurementError(
            f"{path}: {name} has shape {values.shape}, but axes = {axes}; name each axis"
        )
    for axis, entry in table.take.items():
        at = axes.index(axis)
        if entry >= values.shape[at]:
            raise MeasurementError(
                f"{path}: {name}.take: {axis} = {entry}, but that axis has {values.shape[at]} "
                f"entries; choose 0…{values.shape[at] - 1}"
            )
        values = np.take(values, entry, axis=at)
        axes = [one for one in axes if one != axis]
    places = [axis for axis in axes if axis != FREQUENCY]
    count = values.shape[axes.index(FREQUENCY)]
    if count != points:
        raise MeasurementError(
            f"{path}: {name} has shape {values.shape} with axes = {axes}, that is {count} "
            f"frequencies, but there are {points}; correct axes in the mapping"
        )
    ordered = values.transpose([axes.index(axis) for axis in [*places, FREQUENCY]])
    lengths = dict(zip(places, ordered.shape[:-1], strict=True))
    flat = np.ascontiguousarray(ordered.reshape(-1, points), dtype=np.complex128)
    return flat, None if places in ([POSITION], []) else lengths


def array_positions(
    files: ArrayFiles,
    path: Path,
    name: str,
    table: PositionTable,
    *,
    count: int,
    grid: dict[str, int] | None,
) -> Float[np.ndarray, "positions 3"]:
    """Read the positions, or make the line that the mapping gives. [m].

    Parameters
    ----------
    files
        Where arrays are read from.
    path
        The file.
    name
        What they are, for messages.
    table
        Which variables, and in which unit.
    count
        How many positions the samples have.
    grid
        For a scan over a grid, the length of each of its axes, in order.

    Raises
    ------
    MeasurementError
        If there are more or fewer positions than samples have.
    """
    if table.files is not None or table.csv is not None:
        raise MeasurementError(
            f"{path}: {name}: files and csv tell the positions of a folder of Touchstone files; "
            "for arrays give variable, x, y and z, or first and step"
        )
    if table.first is not None and table.step is not None:
        values = np.array(table.first) + np.arange(count)[:, None] * np.array(table.step)
    elif table.named_coordinates() or table.x is not None or table.y is not None or (
        table.z is not None
    ):  # fmt: skip
        values = _coordinates(files, path, name, table, count, grid)
    else:
        values = _real(path, table.variable, files.array(path, table.variable))
        if values.ndim == 2 and table.axes[0] == "axis":
            values = values.T
        if values.ndim != 2 or values.shape[1] != 3:
            raise MeasurementError(
                f"{path}: {name} have shape {values.shape} with axes = {table.axes}; they need "
                "x, y and z: correct axes, or name the coordinates one by one by x, y and z"
            )
    if len(values) != count:
        raise MeasurementError(
            f"{path}: {name}: {len(values)} of them, but the samples have {count}; positions are "
            "missing, or axes is wrong"
        )
    metres = (values - np.array(table.origin)) / LENGTH_UNITS[table.unit]
    return np.ascontiguousarray(metres, dtype=np.float64)


def _coordinates(
    files: ArrayFiles,
    path: Path,
    name: str,
    table: PositionTable,
    count: int,
    grid: dict[str, int] | None,
) -> Float[np.ndarray, "places 3"]:
    given = dict(zip(GRID_AXES, (table.x, table.y, table.z), strict=True))
    lines = {
        axis: _line(path, variable, files.array(path, variable))
        for axis, variable in given.items()
        if isinstance(variable, str)
    }
    constants = {axis: one for axis, one in given.items() if isinstance(one, int | float)}
    if grid is not None:
        for axis, length in grid.items():
            if axis not in lines or lines[axis].size != length:
                found = f"{lines[axis].size} values" if axis in lines else "no variable"
                raise MeasurementError(
                    f"{path}: {name}: {axis} has {found}, but the samples have {length} along "
                    f"{axis!r}; name the variable of that length"
                )
        mesh = np.meshgrid(*(lines[axis] for axis in grid), indexing="ij")
        lines |= {axis: one.ravel() for axis, one in zip(grid, mesh, strict=True)}
    sizes = {axis: one.size for axis, one in lines.items()}
    if len(set(sizes.values())) > 1:
        raise MeasurementError(f"{path}: {name}: coordinates of unequal length ({sizes})")
    values = np.zeros((next(iter(sizes.values()), count), 3))
    for column, axis in enumerate(GRID_AXES):
        values[:, column] = lines.get(axis, constants.get(axis, 0.0))
    return values


def _complex(files: ArrayFiles, path: Path, name: str, table: SamplesTable) -> np.ndarray:
    if table.real is not None and table.imaginary is not None:
        real = _real(path, table.real, files.array(path, table.real))
        imaginary = _real(path, table.imaginary, files.array(path, table.imaginary))
        _refuse_unequal(path, name, real, imaginary)
        return real + 1j * imaginary
    magnitude = table.magnitude or table.magnitude_db
    phase = table.phase_deg or table.phase_rad
    if magnitude is not None and phase is not None:
        size = _real(path, magnitude, files.array(path, magnitude))
        turn = _real(path, phase, files.array(path, phase))
        _refuse_unequal(path, name, size, turn)
        with np.errstate(over="ignore"):  # what overflows is refused as implausible
            size = 10 ** (size / 20) if table.magnitude_db else size
        return size * np.exp(1j * (np.deg2rad(turn) if table.phase_deg else turn))
    values = files.array(path, table.variable)
    if values.dtype.kind != "c":
        raise MeasurementError(
            f"{path}: {name}: {table.variable or 'the array'!r} is real; give complex samples, or "
            "name real and imaginary"
        )
    return values


def _check_axes(path: Path, name: str, axes: list[str], table: SamplesTable) -> None:
    others = [axis for axis in axes if axis not in (POSITION, FREQUENCY, *GRID_AXES)]
    scan = [axis for axis in axes if axis in GRID_AXES]
    if len(set(axes)) < len(axes) or FREQUENCY not in axes or (POSITION in axes and scan):
        raise MeasurementError(
            f'{path}: {name}.axes = {axes}; give "frequency", and "position" or some of "x", "y" '
            'and "z", each once'
        )
    if set(others) != set(table.take):
        raise MeasurementError(
            f"{path}: {name}.take = {table.take}, but the axes besides position and frequency are "
            f"{others}; take one entry of each of them"
        )


def _line(path: Path, name: str | None, values: np.ndarray) -> Float[np.ndarray, " values"]:
    numbers = np.atleast_1d(np.squeeze(_real(path, name, values)))  # MATLAB has no vectors
    if numbers.ndim != 1:
        raise MeasurementError(
            f"{path}: {name or 'the array'!r} has shape {values.shape}; it must be one row of "
            "numbers"
        )
    return numbers


def _real(path: Path, name: str | None, values: np.ndarray) -> Float[np.ndarray, "..."]:
    if values.dtype.kind == "c":
        raise MeasurementError(
            f"{path}: {name or 'the array'!r} is complex; real numbers are needed here"
        )
    return values.astype(np.float64)


def _refuse_unequal(path: Path, name: str, one: np.ndarray, other: np.ndarray) -> None:
    if one.shape != other.shape:
        raise MeasurementError(
            f"{path}: {name}: its two parts have shapes {one.shape} and {other.shape}; they must "
            "be equal"
        )
