"""A folder of files, one for each position: which files, and where each was taken.

Touchstone files are read here; files of arrays or text by :mod:`mmslam.formats.array_reader`.
"""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float

from estimator.measurement.model import MeasurementError
from mmslam.formats.file_pattern import expression_of_pattern, fields_of_pattern
from mmslam.formats.tables.position_table import PositionTable
from mmslam.formats.tables.sources import LENGTH_UNITS
from mmslam.formats.touchstone_files import SUFFIX, Sweep, read_touchstone

COORDINATES = ("x", "y", "z")
TRANSMIT_COORDINATES = ("transmit_x", "transmit_y", "transmit_z")
"""Columns of a list of files, beside ``file``."""

SHOWN = 3
"""How many file names a message shows at most."""

SAME_FREQUENCY = 1.0
"""Two files' grids are one up to this: a hertz turns nothing by 1e-6 rad within 40 m. [Hz]"""


@dataclass(frozen=True, kw_only=True)
class FolderList:
    """The files of a scan, in order, and where the antenna stood for each."""

    files: tuple[Path, ...]
    positions: Float[np.ndarray, "positions 3"]  # [m]
    transmit_positions: Float[np.ndarray, "positions 3"] | None  # None: not listed [m]
    ignored: tuple[str, ...]  # files of the folder, of that kind, that do not belong to the scan
    counted: bool = False  # the numbers in the names rise by one, as indices do


@dataclass(frozen=True, kw_only=True)
class Scan:
    """The S-parameters of all files of a scan."""

    files: tuple[Path, ...]
    frequencies: Float[np.ndarray, " freqs"]  # [Hz]
    samples: Complex[np.ndarray, "positions freqs ports ports"]  # [-]

    def parameter(self, name: str) -> Complex[np.ndarray, "positions freqs"]:
        """Return the S-parameter of a name such as ``S21``."""
        out, into = int(name[1]), int(name[2])
        ports = self.samples.shape[-1]
        if max(out, into) > ports:
            raise MeasurementError(
                f"{self.files[0]}: parameter = {name!r}, but the file has {ports} "
                f"port{'s' if ports > 1 else ''}; choose one of its own"
            )
        return np.ascontiguousarray(self.samples[..., out - 1, into - 1])


def list_folder(
    folder: Path, table: PositionTable, *, base: Path, suffix: re.Pattern[str] = SUFFIX
) -> FolderList:
    """Find the files of a scan and their positions.

    Parameters
    ----------
    folder
        Where the Touchstone files lie.
    table
        A pattern of file names, or a list in a CSV file.
    base
        The folder of the mapping file, to which the list's name is relative; a list that is
        not there is looked for in ``folder``.
    suffix
        Which files may belong to the scan: Touchstone files, or others.

    Raises
    ------
    MeasurementError
        If there is no such file, a listed one is missing, or positions cannot be told.
    """
    if not folder.is_dir():
        raise MeasurementError(f"{folder}: no such folder; give the folder of the sweeps")
    if table.csv is not None:
        return _listed(folder, _list_file(folder, base, table.csv), table, suffix)
    if table.files is None:
        raise MeasurementError(
            f"{folder}: a folder of files, one for each position, needs positions.files (a "
            "pattern) or positions.csv (a list); give one"
        )
    return _matched(folder, table.files, table, suffix)


def read_scan(files: tuple[Path, ...]) -> Scan:
    """Read all files of a scan.

    Raises
    ------
    MeasurementError
        If a file is damaged, or has another frequency grid or number of ports than the first.
    """
    first = read_touchstone(files[0])
    grid = first.frequencies
    samples = np.empty((len(files), *first.samples.shape), dtype=np.complex128)
    unfinished: list[Path] = []
    for row, path in enumerate(files):
        sweep = first if row == 0 else read_touchstone(path)
        _check_alike(path, sweep, files[0], first)
        samples[row] = sweep.samples
        if not sweep.ends_with_newline:
            unfinished.append(path)
    if 0 < len(unfinished) < len(files):
        raise MeasurementError(
            f"{unfinished[0]}: its last line has no end, unlike that of other files here; it may "
            "be truncated: export it again"
        )
    return Scan(files=files, frequencies=grid, samples=samples)


def _check_alike(path: Path, sweep: Sweep, first_path: Path, first: Sweep) -> None:
    count, expected = sweep.frequencies.size, first.frequencies.size
    if count != expected:
        few = path if count < expected else first_path
        raise MeasurementError(
            f"{path}: {count} frequencies, but {first_path.name} has {expected}; {few.name} may "
            "be truncated: export it again"
        )
    ports, expected = sweep.samples.shape[1], first.samples.shape[1]
    if ports != expected:
        raise MeasurementError(
            f"{path}: {ports} ports, but {first_path.name} has {expected}; export all alike"
        )
    apart = np.abs(sweep.frequencies - first.frequencies)
    worst = int(np.argmax(apart))
    if apart[worst] > SAME_FREQUENCY:
        raise MeasurementError(
            f"{path}: frequency {worst} is {sweep.frequencies[worst]:.12g} Hz, but "
            f"{first.frequencies[worst]:.12g} Hz in {first_path.name}; measure all positions on "
            "one grid"
        )


def _matched(
    folder: Path, pattern: str, table: PositionTable, suffix: re.Pattern[str]
) -> FolderList:
    fields = fields_of_pattern(pattern)
    names = _names_in(folder, pattern.count("/"), suffix)
    expression = expression_of_pattern(pattern)
    matches = {name: match for name in names if (match := expression.fullmatch(name))}
    if not matches:
        kind = "Touchstone files" if suffix is SUFFIX else "files of arrays or text"
        raise MeasurementError(
            f"{folder}: none of its {len(names)} {kind} fits files = {pattern!r}"
            + (f" (the first is {names[0]!r})" if names else "")
            + "; correct the pattern"
        )
    ignored = tuple(name for name in names if name not in matches)
    counted = False
    if "index" in fields:
        indices = {name: int(match["index"]) for name, match in matches.items()}
        ordered, positions = _along_line(folder, indices, table)
    else:
        places = np.array(
            [
                [float(match[axis].replace("p", ".")) if axis in fields else 0.0 for axis in "xyz"]
                for match in matches.values()
            ]
        )
        order = np.lexsort(places.T)  # x fastest, as a scanner moves
        ordered = [list(matches)[index] for index in order]
        places = places[order]
        if table.first is not None and table.step is not None:  # the numbers count steps
            places = np.array(table.first) + np.array(table.step) * places
        else:
            counted = _count(places)
        positions = _metres(places, table)
    _refuse_twice(folder, ordered, positions)
    return FolderList(
        files=tuple(folder / name for name in ordered),
        positions=positions,
        transmit_positions=None,
        ignored=ignored,
        counted=counted,
    )


def _names_in(folder: Path, depth: int, suffix: re.Pattern[str]) -> list[str]:
    """List the files of a kind in a folder, or in its folders so deep; none through a link out."""
    root = folder.resolve()
    return sorted(
        entry.relative_to(folder).as_posix()
        for entry in folder.glob("/".join(["*"] * (depth + 1)))
        if suffix.search(entry.name) and (depth == 0 or entry.resolve().is_relative_to(root))
    )


def _count(places: Float[np.ndarray, "positions 3"]) -> bool:
    """Tell whether the numbers along each axis are whole and rise by one."""
    axes = [np.unique(column) for column in places.T]
    return all(bool(np.all(axis == np.round(axis)) and np.all(np.diff(axis) == 1)) for axis in axes)


def _along_line(
    folder: Path, indices: dict[str, int], table: PositionTable
) -> tuple[list[str], Float[np.ndarray, "positions 3"]]:
    ordered = sorted(indices, key=lambda name: indices[name])
    counted = np.array([indices[name] for name in ordered])
    gaps = np.setdiff1d(np.arange(counted[0], counted[-1] + 1), counted)
    if gaps.size:
        raise MeasurementError(
            f"{folder}: no file with the index {gaps[0]} between {counted[0]} and {counted[-1]} "
            f"({gaps.size} missing); measure it again, or list the files in a CSV file"
        )
    if len(np.unique(counted)) < len(counted):
        raise MeasurementError(f"{folder}: two files have the same index; remove one")
    first, step = np.array(table.first), np.array(table.step)
    return ordered, _metres(first + step * (counted - counted[0])[:, None], table)


def _list_file(folder: Path, base: Path, name: str) -> Path:
    candidates = [base / name, folder / name]
    for path in candidates:
        if path.is_file():
            return path
    raise MeasurementError(
        f"{candidates[0]}: no such file; positions.csv names a list with the columns file, x, y, z"
    )


def _listed(folder: Path, path: Path, table: PositionTable, suffix: re.Pattern[str]) -> FolderList:
    try:
        text = path.read_text(encoding="utf-8-sig")
        lines = [one for one in text.splitlines() if one.strip() and not one.startswith("#")]
        semicolons = bool(lines) and ";" in lines[0]
        reader = csv.DictReader(lines, skipinitialspace=True, delimiter=";" if semicolons else ",")
        rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MeasurementError(f"{path}: cannot be read as CSV ({error})") from None
    columns = [name for name in reader.fieldnames or [] if name]
    if "file" not in columns or not {*COORDINATES} & {*columns} or not rows:
        raise MeasurementError(
            f"{path}: columns {', '.join(columns) or 'none'}, {len(rows)} rows; the list needs a "
            "header line with file, x, y, z (y and z may be missing) and a row for each file"
        )
    files = tuple(_inside(folder, path, line, row["file"]) for line, row in enumerate(rows, 2))
    positions = _metres(_coordinates(path, rows, columns, COORDINATES), table)
    transmit = None
    if {*TRANSMIT_COORDINATES} & {*columns}:
        transmit = _metres(_coordinates(path, rows, columns, TRANSMIT_COORDINATES), table)
    else:
        _refuse_twice(path, [file.name for file in files], positions)
    listed = {file.resolve() for file in files}
    ignored = tuple(
        sorted(
            entry.name
            for entry in folder.iterdir()
            if suffix.search(entry.name) and entry.resolve() not in listed
        )
    )
    return FolderList(
        files=files, positions=positions, transmit_positions=transmit, ignored=ignored
    )


def _inside(folder: Path, path: Path, line: int, name: str | None) -> Path:
    file = folder / (name or "")
    if not name or not file.resolve().is_relative_to(folder.resolve()):
        raise MeasurementError(
            f"{path}: line {line}: file = {name!r}; it must be a file in {folder}"
        )
    if not file.is_file():
        raise MeasurementError(
            f"{path}: line {line}: no file {name!r} in {folder}; measure it again, or remove "
            "the line"
        )
    return file


def _coordinates(
    path: Path, rows: list[dict[str, str]], columns: list[str], names: tuple[str, ...]
) -> Float[np.ndarray, "positions 3"]:
    values = np.zeros((len(rows), 3))
    for line, row in enumerate(rows):
        for axis, name in enumerate(names):
            if name not in columns:
                continue
            try:
                values[line, axis] = float(row[name].replace(",", "."))
            except (AttributeError, ValueError):
                values[line, axis] = np.nan
            if not np.isfinite(values[line, axis]):
                raise MeasurementError(
                    f"{path}: line {line + 2}: {name} = {row[name]!r}; the position is missing: "
                    "give a number"
                )
    return values


def _metres(
    values: Float[np.ndarray, "positions 3"], table: PositionTable
) -> Float[np.ndarray, "positions 3"]:
    return np.asarray((values - np.array(table.origin)) / LENGTH_UNITS[table.unit])


def _refuse_twice(
    where: Path, names: list[str], positions: Float[np.ndarray, "positions 3"]
) -> None:
    _, first, count = np.unique(positions, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        place = positions[first[np.argmax(count > 1)]]
        twice = [
            name for name, at in zip(names, positions, strict=True) if np.array_equal(at, place)
        ]
        raise MeasurementError(
            f"{where}: {', '.join(twice[:SHOWN])} have the same position "
            f"{place.tolist()} m; keep one, or distinguish them by {{y}} or {{z}}"
        )
