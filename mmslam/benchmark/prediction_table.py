"""Files of predictions: CSV or Parquet, checked before anything is scored."""

import importlib.util
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from estimator.measurement.model import MeasurementError

FARTHEST = 20.0
"""Largest coordinate that a prediction may have: rooms of the benchmark are below 2 m, and metres
given as millimetres are beyond it. [m]"""


def read_predictions(
    path: Path,
    *,
    keys: Sequence[str],
    values: Sequence[str],
    optional: Sequence[str] = (),
    samples: int,
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
    once
        Whether each combination of keys may stand only once.

    Returns
    -------
    The columns asked for, sorted by the keys.

    Raises
    ------
    MeasurementError
        If the file cannot be read, a column is missing or unknown, or a number is none.
    """
    table = _read(path)
    table.columns = [str(name).strip() for name in table.columns]
    wanted = [*keys, *values]
    missing = [name for name in wanted if name not in table.columns]
    unknown = [name for name in table.columns if name not in (*wanted, *optional)]
    if missing or unknown:
        told = [f"no column {', '.join(missing)}"] if missing else []
        told += [f"unknown column {', '.join(unknown)}"] if unknown else []
        named = ", ".join([*wanted, *(f"{name} (optional)" for name in optional)])
        hint = _unit_hint(missing, unknown)
        raise MeasurementError(f"{path}: {' and '.join(told)}; give {named}{hint}")
    if table.empty:
        table = table.astype(np.float64)
    for name in table.columns:
        if not pd.api.types.is_numeric_dtype(table[name]):
            bad = table[name][pd.to_numeric(table[name], errors="coerce").isna()]
            raise MeasurementError(
                f"{path}: column {name}, row {int(bad.index[0]) + 1}: {bad.iloc[0]!r} is no number"
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


def _read(path: Path) -> pd.DataFrame:
    if not path.is_file():
        raise MeasurementError(f"{path}: no such file; give the file of your predictions")
    if path.suffix == ".parquet":
        if importlib.util.find_spec("pyarrow") is None:
            raise MeasurementError(
                f"{path}: Parquet needs another package: install `mmslam[parquet]`, or give a CSV "
                "file"
            )
        try:
            return pd.read_parquet(path, engine="pyarrow")
        except (OSError, ValueError) as error:
            raise MeasurementError(f"{path}: not a Parquet file ({error})") from None
    if path.suffix != ".csv":
        raise MeasurementError(f"{path}: predictions are a .csv or a .parquet file; rename it")
    try:
        return pd.read_csv(path, skipinitialspace=True)
    except (OSError, ValueError) as error:  # pandas' parser errors are ValueErrors
        raise MeasurementError(
            f"{path}: not a CSV file with a header ({str(error).strip()})"
        ) from None


def _unit_hint(missing: Sequence[str], unknown: Sequence[str]) -> str:
    for name in missing:
        stem, _, unit = name.rpartition("_")
        for other in unknown:
            if stem and unit == "m" and other.rpartition("_")[0] == stem:
                return f". {other} is another unit: give metres as {name}"
    return ""
