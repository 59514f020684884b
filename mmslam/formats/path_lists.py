"""Import of path lists: text tables with a row for each path, or arrays of MATLAB and others."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from estimator.measurement.model import MeasurementError, PathList
from mmslam.formats.array_files import ArrayFiles, is_csv
from mmslam.formats.tables.path_table import PathTable
from mmslam.formats.text.text_numbers import read_columns

PLACE = "place"
"""How users are called that have no names: by the place's number."""


def import_path_lists(source: Path, table: PathTable, base: Path) -> tuple[PathList, ...]:
    """Read the paths of all places of the user.

    Parameters
    ----------
    source
        The file.
    table
        What in it is what.
    base
        Folder to which the mapping's file names are relative.

    Returns
    -------
    One list for each place, in the order of their numbers.

    Raises
    ------
    MeasurementError
        If a column is missing or of another size, a number is missing, or there is no path.
    """
    path = source if table.file is None else base / table.file
    columns = _columns(path, table)
    azimuth = columns[table.azimuth]
    shape = azimuth.shape
    for name, values in columns.items():
        if values.shape != shape and name != table.place:
            raise MeasurementError(
                f"{path}: paths: {name!r} has shape {values.shape}, but {table.azimuth!r} has "
                f"{shape}; all columns must be alike"
            )
    place = _places(path, table, columns, shape)
    gaps = np.isnan(azimuth) | np.isnan(columns[table.delay])
    for name in filter(None, (table.elevation, table.power_db)):
        if np.any(np.isnan(columns[name]) & ~gaps):
            raise MeasurementError(
                f"{path}: paths: {name!r} is NaN where {table.azimuth!r} is a number; leave those "
                "paths out"
            )
    unit = np.pi / 180 if table.angle_unit == "deg" else 1.0
    zero = np.pi / 2 if table.azimuth_zero == "y" else 0.0
    turned = zero + (-unit if table.clockwise else unit) * azimuth
    elevation = None
    if table.elevation is not None:
        elevation = unit * columns[table.elevation]
        elevation = np.pi / 2 - elevation if table.zenith else elevation
    gain = None if table.power_db is None else columns[table.power_db] + table.power_offset_db
    delay = table.seconds() * columns[table.delay]
    lists = []
    for label in np.unique(place[~gaps]):
        rows = (place == label) & ~gaps
        lists.append(
            PathList(
                user=f"{PLACE} {label:g}",
                azimuth=turned[rows],
                elevation=None if elevation is None else elevation[rows],
                delay=delay[rows],
                gain_db=None if gain is None else gain[rows],
                frequency=None if table.frequency_ghz is None else 1e9 * table.frequency_ghz,
                angle_deviation=float(np.radians(table.angle_deviation_deg)),
                delay_deviation=1e-9 * table.delay_deviation_ns,
                gain_deviation_db=table.power_deviation_db,
            )
        )
    if not lists:
        raise MeasurementError(f"{path}: paths: none is there; all entries are NaN")
    return tuple(lists)


def _columns(path: Path, table: PathTable) -> dict[str, Float[np.ndarray, "*shape"]]:
    names = [table.place, table.azimuth, table.elevation, table.delay, table.power_db]
    wanted = [name for name in names if name is not None]
    if path.is_file() and is_csv(path):
        text = read_columns(path)
        missing = [name for name in wanted if name not in text.names]
        if missing:
            raise MeasurementError(
                f"{path}: no column {missing[0]!r} (found: {', '.join(text.names)}); choose one"
            )
        return {name: text.values[:, text.names.index(name)].real for name in wanted}
    files = ArrayFiles(frequency=None, coordinates=())
    found = {}
    for name in wanted:
        values = files.array(path, name, gaps=True)
        if values.dtype.kind == "c":
            raise MeasurementError(f"{path}: paths: {name!r} is complex; it must be real")
        squeezed = np.asarray(values, dtype=np.float64).squeeze()
        found[name] = np.atleast_1d(squeezed)
    return found


def _places(
    path: Path, table: PathTable, columns: dict[str, np.ndarray], shape: tuple[int, ...]
) -> np.ndarray:
    if len(shape) > 2:
        raise MeasurementError(
            f"{path}: paths: {table.azimuth!r} has {len(shape)} axes; a list has one, a matrix of "
            "places times paths two"
        )
    if table.place is None:
        rows = np.arange(shape[0]) if len(shape) == 2 else np.zeros(shape[0])
    else:
        rows = columns[table.place]
        if rows.shape == shape:
            return rows
    if rows.shape != shape[:1]:
        raise MeasurementError(
            f"{path}: paths: {table.place!r} has shape {rows.shape}, but {table.azimuth!r} has "
            f"{shape}; give one for each path, or for each row"
        )
    return np.broadcast_to(rows[:, None], shape) if len(shape) == 2 else rows
