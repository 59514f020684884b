"""Signals as measured, from a folder of Touchstone files or from files of arrays.

Both readers bring units to metres and hertz and the time convention to exp(+jωt), and refuse
what cannot be; nothing is calibrated here.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import MeasurementError, frequency_step
from mmslam.formats.array_files import ArrayFiles
from mmslam.formats.mapped_arrays import array_frequencies, array_positions, array_samples
from mmslam.formats.mapping import (
    PositionTable,
    ResponseTable,
    SamplesTable,
    SignalTable,
    SweepMapping,
)
from mmslam.formats.plausibility import check_frequencies, check_positions, check_samples
from mmslam.formats.touchstone_files import read_touchstone
from mmslam.formats.touchstone_folder import SHOWN, FolderList, Scan, list_folder, read_scan
from scenes.files.toml_reader import is_file

Samples = Complex[np.ndarray, "positions freqs"]
Frequencies = Float[np.ndarray, " freqs"]
Positions = Float[np.ndarray, "positions 3"]


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One signal as measured, in the convention exp(+jωt)."""

    samples: Samples
    frequencies: Frequencies
    positions: Positions
    transmit_positions: Positions | None = None
    notes: tuple[str, ...] = ()


@runtime_checkable
class SignalReader(Protocol):
    """Reads the signals of one source, in the convention exp(+jωt)."""

    def signal(self, name: str, table: SignalTable) -> Signal:
        """Read a signal."""
        ...

    def background(self, name: str, table: SignalTable, given: SamplesTable) -> Signal:
        """Read the background of a signal; one row of samples serves all positions."""
        ...

    def response(self, name: str, table: SignalTable, given: ResponseTable) -> Signal:
        """Read the radio's response: one row of samples."""
        ...

    def transmitters(self, table: PositionTable, count: int) -> Positions:
        """Read where the transmitter stood. [m]."""
        ...


@contextmanager
def told(name: Path | str) -> Iterator[None]:
    """Put the file or table at fault before a message."""
    try:
        yield
    except MeasurementError as error:
        raise MeasurementError(f"{name}: {error}") from None


class FolderReader:
    """Reads signals from folders of Touchstone files."""

    def __init__(self, source: Path, mapping: SweepMapping, base: Path) -> None:
        """Know the data, and the folder to which the mapping's names are relative."""
        self._source, self._mapping, self._base = source, mapping, base
        self._scans: dict[tuple[Path, ...], Scan] = {}
        if mapping.frequency is not None:
            raise MeasurementError(
                f"{source}: Touchstone files tell their frequencies; leave [frequency] out"
            )

    def signal(self, name: str, table: SignalTable) -> Signal:
        """Read a signal."""
        places = self._mapping.positions_of(table)
        listed = self._list(table.folder, places)
        scan = self._scan(listed.files)
        frequencies = _frequencies(str(listed.files[0]), scan.frequencies, self._mapping)
        _check_places(f"{self._source}: {name}", listed.positions, frequencies, places)
        notes: tuple[str, ...] = ()
        if listed.ignored:
            notes = (
                f"{listed.files[0].parent}: {len(listed.ignored)} Touchstone files do not belong "
                f"to the scan and were left out ({', '.join(listed.ignored[:SHOWN])})",
            )
        return Signal(
            samples=_signed(
                f"{self._source}: {name}",
                scan.parameter(self._parameter(name, table)),
                self._mapping,
            ),
            frequencies=frequencies,
            positions=listed.positions,
            transmit_positions=listed.transmit_positions,
            notes=notes,
        )

    def background(self, name: str, table: SignalTable, given: SamplesTable) -> Signal:
        """Read the background, one sweep for each position or one for all."""
        parameter = self._parameter(name, given, table)
        if given.file is not None:
            return self._one_file(given.file, parameter)
        listed = self._list(given.folder or table.folder, self._mapping.positions_of(table))
        scan = self._scan(listed.files)
        return Signal(
            samples=_signed(str(listed.files[0].parent), scan.parameter(parameter), self._mapping),
            frequencies=_frequencies(str(listed.files[0]), scan.frequencies, self._mapping),
            positions=listed.positions,
        )

    def response(self, name: str, table: SignalTable, given: ResponseTable) -> Signal:
        """Read the radio's response: one row of samples."""
        if given.file is None:
            raise MeasurementError(
                f"{self._source}: {name}.response: file is missing; give the Touchstone file of "
                "the through or reference measurement"
            )
        return self._one_file(given.file, self._parameter(name, given, table))

    def transmitters(self, table: PositionTable, count: int) -> Positions:
        """Read where the transmitter stood. [m]."""
        raise MeasurementError(
            f"{self._source}: echo.transmit_positions is for array files; with Touchstone files, "
            "give echo.transmit_offset_m, or columns transmit_x, transmit_y, transmit_z in the "
            "list of positions.csv"
        )

    def _list(self, folder: str | None, places: PositionTable) -> FolderList:
        return list_folder(
            self._source if folder is None else self._source / folder, places, base=self._base
        )

    def _scan(self, files: tuple[Path, ...]) -> Scan:
        if files not in self._scans:
            self._scans[files] = read_scan(files)
        return self._scans[files]

    def _one_file(self, file: str, parameter: str) -> Signal:
        path = self._base / file
        if not is_file(path):
            raise MeasurementError(f"{path}: no such file; correct its name in the mapping")
        sweep = read_touchstone(path)
        scan = Scan(files=(path,), frequencies=sweep.frequencies, samples=sweep.samples[None])
        return Signal(
            samples=_signed(str(path), scan.parameter(parameter), self._mapping),
            frequencies=_frequencies(str(path), sweep.frequencies, self._mapping),
            positions=np.zeros((1, 3)),
        )

    def _parameter(self, name: str, *tables: SamplesTable) -> str:
        for table in tables:
            if table.parameter is not None:
                return table.parameter
        raise MeasurementError(
            f'{self._source}: {name}.parameter is missing; give the S-parameter, as "S21"'
        )


class ArrayReader:
    """Reads signals from files of arrays."""

    def __init__(self, source: Path, mapping: SweepMapping, base: Path) -> None:
        """Know the data, and the folder to which the mapping's names are relative."""
        self._source, self._mapping, self._base = source, mapping, base
        places = [mapping.positions_of(table) for table in mapping.signals().values()]
        if mapping.echo is not None and mapping.echo.transmit_positions is not None:
            places.append(mapping.echo.transmit_positions)
        columns = [name for table in places for name in table.named_coordinates().values()]
        self._files = ArrayFiles(
            frequency=mapping.frequency.variable if mapping.frequency else None,
            coordinates=tuple(dict.fromkeys(columns)),
        )
        if mapping.frequency is None:
            raise MeasurementError(
                f"{source}: [frequency] is missing; name its variable and unit, or give start, "
                "stop and points"
            )

    def signal(self, name: str, table: SignalTable) -> Signal:
        """Read a signal."""
        return self._read(name, table, table, self._source)

    def background(self, name: str, table: SignalTable, given: SamplesTable) -> Signal:
        """Read the background, one row for each position or one for all."""
        merged = _merged(table, given)
        source = self._source if given.file is None else self._base / given.file
        if merged.axes == ["frequency"]:
            return self._spectrum(f"{name}.background", merged, source)
        return self._read(f"{name}.background", table, merged, source)

    def response(self, name: str, table: SignalTable, given: ResponseTable) -> Signal:
        """Read the radio's response: one row of samples."""
        if not given.names_samples() and given.file is None:
            raise MeasurementError(
                f"{self._source}: {name}.response: name its variable, its file or both"
            )
        merged = _merged(table, given).model_copy(
            update={"axes": given.axes or ["frequency"], "take": given.take}
        )
        source = self._source if given.file is None else self._base / given.file
        return self._spectrum(f"{name}.response", merged, source)

    def transmitters(self, table: PositionTable, count: int) -> Positions:
        """Read where the transmitter stood. [m]."""
        return self._positions("echo.transmit_positions", table, self._source, count)

    def _read(self, name: str, table: SignalTable, samples: SamplesTable, source: Path) -> Signal:
        places = self._mapping.positions_of(table)
        frequencies = self._frequencies(source)
        values, grid = array_samples(
            self._files, self._path(samples.file, source), name, samples, len(frequencies)
        )
        if len(values) == 1 and samples is not table:  # a background of one sweep for all
            positions = np.zeros((1, 3))
        else:
            positions = array_positions(
                self._files,
                self._path(places.file, source),
                f"{name}: positions",
                places,
                count=len(values),
                grid=grid,
            )
            _check_places(f"{source}: {name}", positions, frequencies, places)
        return Signal(
            samples=_signed(f"{source}: {name}", values, self._mapping),
            frequencies=frequencies,
            positions=positions,
        )

    def _spectrum(self, name: str, samples: SamplesTable, source: Path) -> Signal:
        frequencies = self._frequencies(source)
        values, _ = array_samples(
            self._files, self._path(samples.file, source), name, samples, len(frequencies)
        )
        if len(values) > 1:
            raise MeasurementError(
                f"{source}: {name} has {len(values)} positions; one sweep serves all: take one"
            )
        return Signal(
            samples=_signed(f"{source}: {name}", values, self._mapping),
            frequencies=frequencies,
            positions=np.zeros((1, 3)),
        )

    def _positions(self, name: str, table: PositionTable, source: Path, count: int) -> Positions:
        return array_positions(
            self._files, self._path(table.file, source), name, table, count=count, grid=None
        )

    def _frequencies(self, source: Path) -> Frequencies:
        table = self._mapping.frequency
        assert table is not None  # checked at the start
        path = self._path(table.file, source)
        return _frequencies(
            str(path), array_frequencies(self._files, path, table), self._mapping, table.unit
        )

    def _path(self, file: str | None, source: Path) -> Path:
        return source if file is None else self._base / file


def _merged(table: SignalTable, given: SamplesTable) -> SamplesTable:
    """Fill what a background or response leaves out from its signal; its file stands apart."""
    own = set(given.model_fields_set)
    if "axes" in own:
        own.add("take")
    if given.names_samples():
        own |= {
            "variable", "real", "imaginary", "magnitude", "magnitude_db", "phase_deg", "phase_rad"
        }  # fmt: skip
    kept = {
        key: getattr(given if key in own else table, key)
        for key in SamplesTable.model_fields
        if key != "file"
    }
    # A background in a file of its own is read from it; in the signal's file, from that.
    kept["file"] = given.file or table.file
    if given.file is not None and given.file.lower().endswith(".npy"):
        kept["variable"] = None
    return SamplesTable.model_construct(**kept)


def _signed(name: str, values: Samples, mapping: SweepMapping) -> Samples:
    check_samples(name, values)
    return np.conj(values) if mapping.time_convention == "exp(-jwt)" else values


def _frequencies(
    name: str, found: Frequencies, mapping: SweepMapping, unit: str | None = None
) -> Frequencies:
    remedy = f"[frequency] unit = {unit!r} may be wrong" if unit else "the file's unit may be wrong"
    check_frequencies(name, found, remedy)
    if np.any(np.diff(found) <= 0):
        raise MeasurementError(f"{name}: the frequencies do not increase; sort them")
    with told(name):
        if found.size < 2:
            frequency_step(found)
        even = np.linspace(found[0], found[-1], found.size)
        if np.abs(found - even).max() <= mapping.frequency_rounded_to_hz:
            found = even
        try:
            frequency_step(found)
        except MeasurementError as error:
            away = np.abs(found - even).max()
            raise MeasurementError(
                f"{error}; if the file's numbers were rounded, set frequency_rounded_to_hz "
                f"(they are up to {away:.3g} Hz off)"
            ) from None
    return found


def _check_places(
    name: str, positions: Positions, frequencies: Frequencies, table: PositionTable
) -> None:
    check_positions(
        name,
        positions,
        speed_of_light / float(frequencies[-1]),
        any_size=table.any_size,
        remedy=f"[positions] unit = {table.unit!r} may be wrong; if it is not, set any_size = true",
    )
