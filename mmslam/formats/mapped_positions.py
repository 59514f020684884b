"""Positions by a mapping: a list, coordinates of a grid or a mesh, or equal steps."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from estimator.measurement.model import MeasurementError
from mmslam.formats.array_files import ArrayFiles
from mmslam.formats.mapped_arrays import line_of, real_array
from mmslam.formats.tables.position_table import PositionTable
from mmslam.formats.tables.sources import LENGTH_UNITS

AXES = ("x", "y", "z")

Grid = dict[str, int]
"""Of a scan over a grid, the length of each of its axes, in the order of the samples."""


def array_positions(
    files: ArrayFiles,
    path: Path,
    name: str,
    table: PositionTable,
    *,
    base: Path,
    count: int,
    grid: Grid | None,
) -> Float[np.ndarray, "positions 3"]:
    """Read the positions, or make the line or grid that the mapping gives. [m].

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
    base
        Folder to which file names are relative.
    count
        How many positions the samples have.
    grid
        For a scan over a grid, the length of each of its axes, in order.

    Raises
    ------
    MeasurementError
        If there are more or fewer positions than samples have, or the grid is not the samples'.
    """
    if table.files is not None or table.csv is not None:
        raise MeasurementError(
            f"{path}: {name}: files and csv tell the positions of a folder of files; for one file "
            "give variable, x, y and z, or first and step"
        )
    if table.first is not None and table.step is not None:
        values = _equal_steps(path, name, np.array(table.first), np.array(table.step), count, grid)
    elif table.coordinates():
        values = _coordinates(files, path, name, table, base=base, count=count, grid=grid)
    else:
        values = real_array(path, table.variable, files.array(path, table.variable))
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
    if table.snake:
        values = _turned_rows(path, name, values, grid)
    metres = (values - np.array(table.origin)) / LENGTH_UNITS[table.unit]
    return np.ascontiguousarray(metres, dtype=np.float64)


def _equal_steps(
    path: Path,
    name: str,
    first: Float[np.ndarray, " 3"],
    step: Float[np.ndarray, " 3"],
    count: int,
    grid: Grid | None,
) -> Float[np.ndarray, "places 3"]:
    if grid is None or len(grid) == 1:
        return np.asarray(first + np.arange(count)[:, None] * step)
    if "azimuth" in grid:
        raise MeasurementError(
            f"{path}: {name}: first and step are lengths, but the samples have an axis 'azimuth'; "
            "give azimuth_deg, radius and z"
        )
    for axis, one in zip(AXES, step, strict=True):
        if (axis in grid) != (one != 0):
            raise MeasurementError(
                f"{path}: {name}: the samples have axes {' and '.join(grid)}, but step = "
                f"{step.tolist()}; give a step along each of these axes, and 0 along any other"
            )
    steps = np.stack(np.meshgrid(*map(np.arange, grid.values()), indexing="ij"), axis=-1)
    values = np.tile(first, (count, 1))
    for column, axis in enumerate(grid):
        at = AXES.index(axis)
        values[:, at] += steps[..., column].ravel() * step[at]
    return values


def _coordinates(
    files: ArrayFiles,
    path: Path,
    name: str,
    table: PositionTable,
    *,
    base: Path,
    count: int,
    grid: Grid | None,
) -> Float[np.ndarray, "places 3"]:
    given = table.coordinates()
    lines: dict[str, np.ndarray] = {}
    for axis, one in given.items():
        if one.value is None:
            place = path if one.file is None else base / one.file
            found = real_array(place, one.variable, files.array(place, one.variable))
            lines[axis] = (
                line_of(place, one.variable, found)
                if grid is None
                else _over_grid(path, name, axis, np.squeeze(found), grid)
            )
    for axis in grid or {}:
        if axis not in lines:
            raise MeasurementError(
                f"{path}: {name}: {axis} has no variable, but the samples have "
                f"{(grid or {})[axis]} along {axis!r}; name the variable of that length, or give "
                "first and step"
            )
    sizes = {axis: one.size for axis, one in lines.items()}
    if len(set(sizes.values())) > 1:
        raise MeasurementError(f"{path}: {name}: coordinates of unequal length ({sizes})")
    size = next(iter(sizes.values()), count)
    columns = {axis: np.full(size, one.value) for axis, one in given.items() if axis not in lines}
    columns |= lines
    if "azimuth" in columns:
        angle = np.deg2rad(columns["azimuth"]) * (-1 if table.turntable else 1)
        columns["x"] = columns["radius"] * np.cos(angle)
        columns["y"] = columns["radius"] * np.sin(angle)
    return np.stack([columns.get(axis, np.zeros(size)) for axis in AXES], axis=-1)


def _turned_rows(
    path: Path, name: str, values: Float[np.ndarray, "places 3"], grid: Grid | None
) -> Float[np.ndarray, "places 3"]:
    """Turn every second row of a grid, as a scanner moves that measures there and back."""
    if grid is None or len(grid) != 2:
        raise MeasurementError(
            f"{path}: {name}: snake = true needs a grid of two axes; name them in the samples' "
            'axes, the slower first, as ["z", "x", "frequency"]'
        )
    rows = values.reshape(*grid.values(), 3).copy()
    rows[1::2] = rows[1::2, ::-1]
    return rows.reshape(-1, 3)


def _over_grid(
    path: Path, name: str, axis: str, values: Float[np.ndarray, "..."], grid: Grid
) -> Float[np.ndarray, " places"]:
    """Spread the coordinate along its axis over the grid, or unfold a mesh of it."""
    shape, axes = tuple(grid.values()), list(grid)
    if values.ndim <= 1 and axis in grid:
        if values.size != grid[axis]:
            raise MeasurementError(
                f"{path}: {name}: {axis} has {values.size} values, but the samples have "
                f"{grid[axis]} along {axis!r}; name the variable of that length"
            )
        along = [-1 if one == axis else 1 for one in axes]
        return np.broadcast_to(values.reshape(along), shape).ravel()
    if values.shape != shape and values.size != np.prod(shape):
        raise MeasurementError(
            f"{path}: {name}: {axis} has shape {values.shape}, but the samples have {grid}; a mesh "
            "of coordinates needs the order of the samples' axes"
        )
    mesh = values.reshape(shape) if values.ndim == 1 else values
    turned = mesh.shape != shape
    if not turned and axis in grid and len(shape) > 1:
        others = tuple(at for at, one in enumerate(axes) if one != axis)
        along, across = np.ptp(mesh, axis=axes.index(axis)), np.ptp(mesh, axis=others)
        turned = bool(along.max() < across.max())
    if turned:
        raise MeasurementError(
            f"{path}: {name}: the mesh of {axis} (shape {values.shape}) varies along another axis "
            f"than the samples' {axis!r} ({grid}); correct axes, as {list(reversed(axes))}"
        )
    return mesh.ravel()
