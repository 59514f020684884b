"""Files of predictions: CSV or Parquet, checked before anything is scored."""

import importlib.util
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from estimator.measurement.model import MeasurementError
from mmslam.plain_text import message

FARTHEST = 20.0
"""Largest coordinate that a prediction may have: rooms of the benchmark are below 2 m, and metres
given as millimetres are beyond it. [m]"""

SPARE = 2
"""So many times the rows that a part can have are still read, for a message that names the row
that is too many. [-]"""

BYTES_PER_NUMBER = 64
"""A double has at most 24 signs in decimals that tell it exactly; the rest is for a separator,
quotes and blanks. Nor does a number take more in Parquet, with its page's header. [B]"""

BYTES_OF_FRAME = 2**20
"""What a file may have beside its numbers: header, or Parquet's schema and statistics. [B]"""

LONGEST_HEADER = 4096
"""Longest header of a CSV file: columns are a handful, each with a short name. [B]"""

NAMES_SHOWN = 5
"""So many unknown columns are named in a message. [-]"""


def read_predictions(
    path: Path,
    *,
    keys: Sequence[str],
    values: Sequence[str],
    optional: Sequence[str] = (),
    samples: int,
    rows: int,
    once: bool = True,
) -> pd.DataFrame:
    """Read a file of predictions.

    Parameters
    ----------
    path
        A CSV file with a header, or a Parquet file (extra ``parquet``).
    keys
        Columns of whole numbers that say what a row is about; the first is ``sample``.
    values
        Columns of numbers that must be there.
    optional
        Columns of numbers that may be there.
    samples
        How many there are: numbers are 0 to one less.
    rows
        The most rows that make sense. A file of more than :data:`SPARE` times as many, or larger
        than so many rows can be, is refused before it is read.
    once
        Whether each combination of keys may stand only once.

    Returns
    -------
    The columns asked for, sorted by the keys.

    Raises
    ------
    MeasurementError
        If the file cannot be read, is too large, a column is missing or unknown, or a number is
        none.
    """
    wanted = [*keys, *values]
    table = _read(path, rows=SPARE * rows, columns=len(wanted) + len(optional))
    table.columns = [str(name).strip() for name in table.columns]
    twice = table.columns[table.columns.duplicated()]
    if len(twice):
        raise MeasurementError(f"{path}: column {_plain(twice[0])} stands twice; give it once")
    missing = [name for name in wanted if name not in table.columns]
    unknown = [name for name in table.columns if name not in (*wanted, *optional)]
    if missing or unknown:
        told = [f"no column {', '.join(missing)}"] if missing else []
        told += [f"unknown column {_some(unknown)}"] if unknown else []
        named = ", ".join([*wanted, *(f"{name} (optional)" for name in optional)])
        hint = _unit_hint(missing, unknown)
        raise MeasurementError(f"{path}: {' and '.join(told)}; give {named}{hint}")
    if table.empty:
        table = table.astype(np.float64)
    for name in table.columns:
        if not pd.api.types.is_numeric_dtype(table[name]):
            bad = table[name][pd.to_numeric(table[name], errors="coerce").isna()]
            raise MeasurementError(
                f"{path}: column {name}, row {int(bad.index[0]) + 1}: "
                f"{_plain(repr(bad.iloc[0]))} is no number"
            )
    for name in (*keys, *(one for one in ("found",) if one in table.columns)):
        column = table[name].to_numpy(dtype=np.float64)
        _refuse(path, name, column, ~np.isfinite(column), "is missing or NaN; give a number")
        _refuse(path, name, column, column != np.round(column), "is no whole number")
        table[name] = column.astype(np.int64)
    numbers = table["sample"].to_numpy()
    _refuse(
        path,
        "sample",
        numbers,
        (numbers < 0) | (numbers >= samples),
        f"is none of the {samples} samples, 0 to {samples - 1}; is --size that of the part?",
    )
    if once:
        again = table.duplicated(list(keys)).to_numpy()
        if again.any():
            row = int(np.flatnonzero(again)[0])
            place = ", ".join(f"{name} {table[name].iloc[row]}" for name in keys)
            raise MeasurementError(
                f"{path}: row {row + 1}: {place} stands twice; give one row for each"
            )
    return table.sort_values(list(keys), kind="stable").reset_index(drop=True)


def refuse_missing(path: Path, table: pd.DataFrame, samples: int) -> None:
    """Refuse a table that lacks samples.

    Raises
    ------
    MeasurementError
        Naming the first few.
    """
    absent = sorted(set(range(samples)) - set(table["sample"].tolist()))
    if absent:
        some = ", ".join(map(str, absent[:5])) + (", …" if len(absent) > 5 else "")
        raise MeasurementError(
            f"{path}: {len(absent)} of {samples} samples are missing ({some}); give a row for each"
        )


def refuse_wild(path: Path, table: pd.DataFrame, columns: Sequence[str]) -> None:
    """Refuse coordinates that are NaN, infinite, or in another unit than metres.

    Raises
    ------
    MeasurementError
        Naming row, value and remedy.
    """
    for name in columns:
        column = table[name].to_numpy(dtype=np.float64)
        _refuse(path, name, column, ~np.isfinite(column), "is no finite number; give one")
        _refuse(
            path,
            name,
            column,
            np.abs(column) > FARTHEST,
            f"m is beyond {FARTHEST:g} m, outside of every room; coordinates are in metres, are "
            "these millimetres?",
        )


def _refuse(path: Path, name: str, column: np.ndarray, bad: np.ndarray, told: str) -> None:
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        more = f" ({int(bad.sum())} such rows)" if bad.sum() > 1 else ""
        raise MeasurementError(f"{path}: row {row + 1}: {name} = {column[row]:g} {told}{more}")


def _read(path: Path, *, rows: int, columns: int) -> pd.DataFrame:
    if not path.is_file():
        raise MeasurementError(f"{path}: no such file; give the file of your predictions")
    if path.suffix not in (".csv", ".parquet"):
        raise MeasurementError(f"{path}: predictions are a .csv or a .parquet file; rename it")
    if path.suffix == ".parquet" and importlib.util.find_spec("pyarrow") is None:
        raise MeasurementError(
            f"{path}: Parquet needs another package: install `mmslam[parquet]`, or give a CSV file"
        )
    most = BYTES_OF_FRAME + BYTES_PER_NUMBER * columns * rows
    size = path.stat().st_size
    if size > most:
        raise MeasurementError(
            f"{path}: {size} bytes are more than {most}, which {rows} rows of {columns} numbers "
            "can take; give the predictions of this part alone, or its --size"
        )
    return _read_parquet(path, rows, most) if path.suffix == ".parquet" else _read_csv(path, rows)


def _read_csv(path: Path, rows: int) -> pd.DataFrame:
    try:
        with path.open("rb") as stream:
            header = stream.readline(LONGEST_HEADER + 1)
        if len(header) > LONGEST_HEADER:
            raise MeasurementError(
                f"{path}: its first line has more than {LONGEST_HEADER} bytes; give a header with "
                "the columns' names"
            )
        table = pd.read_csv(path, skipinitialspace=True, nrows=rows + 1)
    except (OSError, ValueError, OverflowError) as error:  # pandas' parser errors are ValueErrors
        if isinstance(error, MeasurementError):
            raise
        raise MeasurementError(
            f"{path}: not a CSV file with a header ({_plain(str(error).strip())})"
        ) from None
    if len(table) > rows:
        raise MeasurementError(_too_many(path, f"more than {rows}", rows))
    return table


def _read_parquet(path: Path, rows: int, most: int) -> pd.DataFrame:
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(path) as file:
            told = file.metadata
            groups = [told.row_group(at) for at in range(told.num_row_groups)]
            # A few bytes can stand for any number of equal values, and of values in nested rows.
            values = [
                group.column(at).num_values for group in groups for at in range(group.num_columns)
            ]
            count = max(told.num_rows, sum(group.num_rows for group in groups), *values, 0)
            unpacked = sum(group.total_byte_size for group in groups)
        if count > rows:
            raise MeasurementError(_too_many(path, str(count), rows))
        if unpacked > most:
            raise MeasurementError(
                f"{path}: its columns unpack to {unpacked} bytes, more than {most}, which {rows} "
                "rows of numbers can take; give numbers alone"
            )
        return pd.read_parquet(path, engine="pyarrow")
    except MeasurementError:
        raise
    except Exception as error:  # Arrow fails in many ways on a damaged file
        raise MeasurementError(
            f"{path}: not a Parquet file ({_plain(f'{type(error).__name__}: {error}')}); it may be "
            "damaged: write it again"
        ) from None


def _too_many(path: Path, count: str, rows: int) -> str:
    return (
        f"{path}: {count} rows, but {rows // SPARE} are the most that this part can have "
        f"({SPARE} times as many are read); is --size that of the part?"
    )


def _plain(text: str) -> str:
    """Show what came from a file or a library's message: visible, in one line, and cut."""
    return message(" ".join(text.split()))


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMES_SHOWN} more" if len(names) > NAMES_SHOWN else ""
    return ", ".join(_plain(name) for name in names[:NAMES_SHOWN]) + more


def _unit_hint(missing: Sequence[str], unknown: Sequence[str]) -> str:
    for name in missing:
        stem, _, unit = name.rpartition("_")
        for other in unknown:
            if stem and unit == "m" and other.rpartition("_")[0] == stem:
                return f". {_plain(other)} is another unit: give metres as {name}"
    return ""
