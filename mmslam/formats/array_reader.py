"""Signals from files of arrays or text: one file of all positions, or a file for each."""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Num

from estimator.measurement.model import MeasurementError
from mmslam.formats.array_files import SUFFIXES, ArrayFiles
from mmslam.formats.mapped_arrays import array_frequencies, array_samples
from mmslam.formats.mapped_positions import Grid, array_positions
from mmslam.formats.mapping import SweepMapping
from mmslam.formats.measured_signals import (
    Frequencies,
    Positions,
    Samples,
    Signal,
    check_places,
    finished,
    measured_positions,
    signed,
)
from mmslam.formats.plausibility import check_frequencies
from mmslam.formats.tables.position_table import PositionTable
from mmslam.formats.tables.signal_tables import (
    REPRESENTATION,
    ResponseTable,
    SamplesTable,
    SignalTable,
)
from mmslam.formats.time_domain.chirps import (
    analytic_signal,
    chirp_frequencies,
    without_residual_video_phase,
)
from mmslam.formats.time_domain.traces import TraceTimes, spectrum_of_traces, trace_times
from mmslam.formats.touchstone_folder import FolderList, list_folder

FILES = re.compile(rf"({'|'.join(map(re.escape, SUFFIXES))}|\.bin|\.raw)$", re.IGNORECASE)
"""Names of files that hold arrays or text."""


class ArrayReader:
    """Reads signals from a file of arrays, or from a folder with one for each position."""

    def __init__(self, source: Path, mapping: SweepMapping, base: Path) -> None:
        """Take the data, and the folder to which the mapping's file names are relative."""
        self._source, self._mapping, self._base = source, mapping, base
        places = [mapping.positions_of(table) for table in mapping.signals().values()]
        if mapping.echo is not None and mapping.echo.transmit_positions is not None:
            places.append(mapping.echo.transmit_positions)
        columns = [name for table in places for name in table.named_coordinates().values()]
        self._files = ArrayFiles(
            frequency=mapping.sweep_column(), coordinates=tuple(dict.fromkeys(columns))
        )
        if not (mapping.frequency or mapping.time or mapping.chirp):
            raise MeasurementError(
                f"{source}: [frequency] is missing; name its variable and unit, or give start, "
                "stop and points; or give [time] of traces, or [chirp] of a radar's beats"
            )

    def signal(self, name: str, table: SignalTable) -> Signal:
        """Read a signal."""
        return self._read(name, table, table, self._source)

    def background(self, name: str, table: SignalTable, given: SamplesTable) -> Signal:
        """Read the background, one row for each position or one for all."""
        merged = _merged(table, given)
        if given.folder is not None:
            return self._read(f"{name}.background", table, merged, self._source)
        source = self._source if given.file is None else self._base / given.file
        if merged.axes == [self._mapping.sweep_axis()] or (
            self._source.is_dir() and given.file is not None
        ):
            return self._spectrum(f"{name}.background", merged, source)
        return self._read(f"{name}.background", table, merged, source)

    def response(self, name: str, table: SignalTable, given: ResponseTable) -> Signal:
        """Read the radio's response: one row of samples."""
        if not given.names_samples() and given.file is None:
            raise MeasurementError(
                f"{self._source}: {name}.response: name its variable, its file or both"
            )
        merged = _merged(table, given).model_copy(
            update={"axes": given.axes or [self._mapping.sweep_axis()], "take": given.take}
        )
        source = self._source if given.file is None else self._base / given.file
        return self._spectrum(f"{name}.response", merged, source)

    def transmitters(self, table: PositionTable, count: int) -> Positions:
        """Read where the transmitter stood. [m]."""
        return self._positions("echo.transmit_positions", table, self._source, count, None)

    def _read(self, name: str, table: SignalTable, samples: SamplesTable, source: Path) -> Signal:
        if source.is_dir():
            return self._read_folder(name, table, samples, source)
        places = self._mapping.positions_of(table)
        where = f"{source}: {name}"
        values, grid = self._samples(name, samples, source)
        if len(values) == 1 and samples is not table:  # a background of one sweep for all
            positions = np.zeros((1, 3))
        else:
            positions = self._positions(f"{name}: positions", places, source, len(values), grid)
        keep, dead = measured_positions(where, values, table.leave_out)
        found, frequencies, notes = self._sweep(where, values[keep], samples, source)
        if samples is table or len(values) > 1:
            notes += check_places(where, positions, float(frequencies.max()), places)
        return finished(
            where, found, frequencies, positions[keep], self._mapping, notes=dead + notes
        )

    def _read_folder(
        self, name: str, table: SignalTable, samples: SamplesTable, source: Path
    ) -> Signal:
        places = self._mapping.positions_of(table)
        folder = source if samples.folder is None else source / samples.folder
        listed: FolderList = list_folder(folder, places, base=self._base, suffix=FILES)
        where = f"{folder}: {name}"
        rows = []
        first: Frequencies | None = None
        for path in listed.files:
            values, _ = self._samples(name, samples, path)
            if len(values) != 1:
                raise MeasurementError(
                    f"{path}: {name} has {len(values)} positions; a folder needs one in each file"
                )
            found, frequencies, notes = self._sweep(f"{path}: {name}", values, samples, path)
            if first is None:
                first = frequencies
            elif first.shape != frequencies.shape or not np.allclose(first, frequencies, rtol=1e-9):
                raise MeasurementError(
                    f"{path}: its {frequencies.size} frequencies are not those of "
                    f"{listed.files[0].name} ({first.size}); measure all positions alike"
                )
            rows.append(found[0])
        assert first is not None  # a list of no files is refused
        notes += check_places(
            where, listed.positions, float(first.max()), places, counted=listed.counted
        )
        return finished(
            where,
            np.stack(rows),
            first,
            listed.positions,
            self._mapping,
            leave_out=table.leave_out,
            transmit_positions=listed.transmit_positions,
            notes=notes,
        )

    def _spectrum(self, name: str, samples: SamplesTable, source: Path) -> Signal:
        values, _ = self._samples(name, samples, source)
        if len(values) > 1:
            raise MeasurementError(
                f"{source}: {name} has {len(values)} positions; one sweep serves all: take one"
            )
        where = f"{source}: {name}"
        found, frequencies, notes = self._sweep(where, values, samples, source)
        return finished(where, found, frequencies, np.zeros((1, 3)), self._mapping, notes=notes)

    def _samples(
        self, name: str, table: SamplesTable, source: Path
    ) -> tuple[Num[np.ndarray, "positions points"], Grid | None]:
        points = None
        if self._mapping.frequency is not None:
            points = self._frequencies(source).size
        elif self._mapping.time is not None:
            points = self._times(source).points
        values, grid = array_samples(
            self._files,
            self._path(table.file, source),
            name,
            table,
            base=self._base,
            sweep=self._mapping.sweep_axis(),
            points=points,
        )
        return signed(f"{source}: {name}", values, self._mapping), grid

    def _sweep(
        self,
        where: str,
        values: Num[np.ndarray, "positions points"],
        table: SamplesTable,
        source: Path,
    ) -> tuple[Samples, Frequencies, tuple[str, ...]]:
        """Convert samples over frequency, time or a chirp to a frequency sweep and its remarks."""
        if self._mapping.time is not None:
            return spectrum_of_traces(where, values, self._times(source), self._mapping.time)
        if self._mapping.chirp is not None:
            frequencies = chirp_frequencies(self._mapping.chirp, values.shape[1])
            if values.dtype.kind != "c":
                values = analytic_signal(values, rising=self._mapping.chirp.slope_mhz_per_us > 0)
            return without_residual_video_phase(values, self._mapping.chirp), frequencies, ()
        frequencies = self._frequencies(source)
        if table.analytic:
            if values.dtype.kind == "c":
                raise MeasurementError(
                    f"{where}: analytic = true, but the samples are complex; leave it out"
                )
            values = analytic_signal(values, rising=bool(frequencies[-1] > frequencies[0]))
        return values, frequencies, ()

    def _positions(
        self, name: str, table: PositionTable, source: Path, count: int, grid: Grid | None
    ) -> Positions:
        path = self._path(table.file, source)
        return array_positions(
            self._files, path, name, table, base=self._base, count=count, grid=grid
        )

    def _frequencies(self, source: Path) -> Frequencies:
        table = self._mapping.frequency
        assert table is not None  # asked for where it is given only
        path = self._path(table.file, source)
        found = array_frequencies(self._files, path, table)
        check_frequencies(str(path), found, f"[frequency] unit = {table.unit!r} may be wrong")
        return found

    def _times(self, source: Path) -> TraceTimes:
        table = self._mapping.time
        assert table is not None  # asked for where it is given only
        return trace_times(self._files, self._path(table.file, source), table)

    def _path(self, file: str | None, source: Path) -> Path:
        return source if file is None else self._base / file


def _merged(table: SignalTable, given: SamplesTable) -> SamplesTable:
    """Complete the table of a background or response by its signal's keys, but not by its file."""
    own = set(given.model_fields_set)
    if "axes" in own:
        own.add("take")
    if given.names_samples():
        own |= set(REPRESENTATION)
    kept = {
        key: getattr(given if key in own else table, key)
        for key in SamplesTable.model_fields
        if key != "file"
    }
    # A background in a file of its own is read from it; in the signal's file, from that.
    kept["file"] = given.file or table.file
    if given.file is not None and given.file.lower().endswith(".npy") and not given.variable:
        kept["variable"] = None
    return SamplesTable.model_construct(**kept)
