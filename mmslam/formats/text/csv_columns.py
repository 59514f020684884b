"""A CSV file with a header line and a row for each sample, laid out on its grid.

A row tells one position and one frequency; rows may come in any order, but each pair exactly
once. A file that tells only frequencies or only positions is one axis long.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from estimator.measurement.model import MeasurementError
from mmslam.formats.text.text_numbers import read_columns


@dataclass(frozen=True, kw_only=True)
class CsvGrid:
    """The columns of a CSV file, each over positions and frequencies (those that it tells)."""

    path: Path
    arrays: dict[str, np.ndarray]  # frequency [freqs]; coordinates [positions]; others: both

    def array(self, name: str) -> np.ndarray:
        """Return a column on the grid."""
        if name not in self.arrays:
            found = ", ".join(self.arrays)
            raise MeasurementError(f"{self.path}: no column {name!r} (found: {found}); choose one")
        return self.arrays[name]


def read_csv_grid(path: Path, *, frequency: str | None, coordinates: tuple[str, ...]) -> CsvGrid:
    """Read a CSV file.

    Parameters
    ----------
    path
        The file: names of the columns, then numbers; see :mod:`.text_numbers`.
    frequency
        The column of the frequency, if there is one.
    coordinates
        The columns of the position.

    Raises
    ------
    MeasurementError
        If it is no such file, a number is missing, or the rows fill no grid.
    """
    table = read_columns(path)
    names, values = table.names, table.values
    columns = {
        name: column if np.iscomplexobj(column) and column.imag.any() else column.real
        for name, column in zip(names, values.T, strict=True)
    }
    keys = [name for name in coordinates if name in columns]
    where = np.zeros(len(values), dtype=np.int64)
    sweep = np.zeros(len(values), dtype=np.int64)
    arrays: dict[str, np.ndarray] = {}
    shape: tuple[int, ...] = ()
    if keys:
        places, where = _by_appearance(np.column_stack([columns[name] for name in keys]))
        arrays |= {name: places[:, axis] for axis, name in enumerate(keys)}
        shape += (len(places),)
    if frequency is not None and frequency in columns:
        arrays[frequency], sweep = np.unique(columns[frequency], return_inverse=True)
        shape += (arrays[frequency].size,)
    if not shape:
        wanted = ", ".join(filter(None, [frequency, *coordinates])) or "any column"
        raise MeasurementError(
            f"{path}: the mapping names no column of frequency or position (named: {wanted}; "
            f"found: {', '.join(names)}); name one"
        )
    _refuse_gaps(path, where, sweep, shape, keys, frequency, arrays)
    cell = np.lexsort((sweep, where))  # by position, then by frequency
    for name, column in columns.items():
        if name not in arrays:
            arrays[name] = column[cell].reshape(shape)
    return CsvGrid(path=path, arrays=arrays)


def _by_appearance(
    rows: Float[np.ndarray, "rows keys"],
) -> tuple[Float[np.ndarray, "distinct keys"], Int[np.ndarray, " rows"]]:
    distinct, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    return distinct[order], rank[inverse.ravel()]


def _refuse_gaps(
    path: Path,
    where: Int[np.ndarray, " rows"],
    sweep: Int[np.ndarray, " rows"],
    shape: tuple[int, ...],
    keys: list[str],
    frequency: str | None,
    arrays: dict[str, np.ndarray],
) -> None:
    points = shape[-1] if len(shape) == 2 or not keys else 1
    cells, count = np.unique(where * points + sweep, return_counts=True)
    if cells.size == np.prod(shape) and (count == 1).all():
        return
    if (count > 1).any():
        cell, found = int(cells[np.argmax(count > 1)]), f"{count.max()} rows"
    else:  # the first of the grid's cells that is skipped
        skipped = np.flatnonzero(cells != np.arange(cells.size))
        cell, found = int(skipped[0]) if skipped.size else cells.size, "no row"
    place = [f"{name} = {arrays[name][cell // points]:.9g}" for name in keys]
    if frequency in arrays:
        place.append(f"{frequency} = {arrays[frequency][cell % points]:.9g}")
    raise MeasurementError(
        f"{path}: {found} for {', '.join(place)} ({where.size} rows for {np.prod(shape)} pairs of "
        "position and frequency); every position needs every frequency exactly once: it may be "
        "truncated, or the mapping names other columns"
    )
