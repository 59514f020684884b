"""Signals as measured, from a folder of Touchstone files or from files of arrays.

Both readers convert units to metres and hertz and the time convention to exp(+jωt), and refuse
impossible values; nothing is calibrated here.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Complex, Float, Num
from scipy.constants import speed_of_light

from estimator.measurement.model import MeasurementError
from mmslam.formats.frequency_grid import ordered_sweep
from mmslam.formats.mapping import SweepMapping
from mmslam.formats.plausibility import check_positions, check_samples
from mmslam.formats.tables.position_table import PositionTable
from mmslam.formats.tables.signal_tables import ResponseTable, SamplesTable, SignalTable
from mmslam.formats.touchstone_files import read_touchstone
from mmslam.formats.touchstone_folder import SHOWN, FolderList, Scan, list_folder, read_scan
from scenes.files.toml_reader import is_file

MOST_MISSING = 0.1
"""Largest part of the positions that is left out without being told to: it lowers a focus by 1 dB
and raises its side lobes to −20 dB. [-]"""

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
    """Prefix error messages in the block with the name of the file or table."""
    try:
        yield
    except MeasurementError as error:
        raise MeasurementError(f"{name}: {error}") from None


class FolderReader:
    """Reads signals from folders of Touchstone files."""

    def __init__(self, source: Path, mapping: SweepMapping, base: Path) -> None:
        """Take the data, and the folder to which the mapping's file names are relative."""
        self._source, self._mapping, self._base = source, mapping, base
        self._scans: dict[tuple[Path, ...], Scan] = {}
        if mapping.frequency or mapping.time or mapping.chirp:
            raise MeasurementError(
                f"{source}: Touchstone files tell their frequencies; leave "
                f"[{'chirp' if mapping.chirp else 'time' if mapping.time else 'frequency'}] out"
            )

    def signal(self, name: str, table: SignalTable) -> Signal:
        """Read a signal."""
        places = self._mapping.positions_of(table)
        listed = self._list(table.folder, places)
        scan = self._scan(listed.files)
        where = f"{self._source}: {name}"
        notes = check_places(
            where, listed.positions, float(scan.frequencies.max()), places, counted=listed.counted
        )
        if listed.ignored:
            notes += (
                f"{listed.files[0].parent}: {len(listed.ignored)} Touchstone files do not belong "
                f"to the scan and were left out ({', '.join(listed.ignored[:SHOWN])})",
            )
        return finished(
            where,
            signed(where, scan.parameter(self._parameter(name, table)), self._mapping)
            * table.scale,
            scan.frequencies,
            listed.positions,
            self._mapping,
            leave_out=table.leave_out,
            transmit_positions=listed.transmit_positions,
            notes=notes,
        )

    def background(self, name: str, table: SignalTable, given: SamplesTable) -> Signal:
        """Read the background, one sweep for each position or one for all."""
        parameter = self._parameter(name, given, table)
        if given.file is not None:
            return self._one_file(given.file, parameter, table.scale)
        listed = self._list(given.folder or table.folder, self._mapping.positions_of(table))
        scan = self._scan(listed.files)
        where = str(listed.files[0].parent)
        samples = signed(where, scan.parameter(parameter), self._mapping) * table.scale
        return finished(where, samples, scan.frequencies, listed.positions, self._mapping)

    def response(self, name: str, table: SignalTable, given: ResponseTable) -> Signal:
        """Read the radio's response: one row of samples."""
        if given.file is None:
            raise MeasurementError(
                f"{self._source}: {name}.response: file is missing; give the Touchstone file of "
                "the through or reference measurement"
            )
        return self._one_file(given.file, self._parameter(name, given, table), given.scale)

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

    def _one_file(self, file: str, parameter: str, scale: float) -> Signal:
        path = self._base / file
        if not is_file(path):
            raise MeasurementError(f"{path}: no such file; correct its name in the mapping")
        sweep = read_touchstone(path)
        scan = Scan(files=(path,), frequencies=sweep.frequencies, samples=sweep.samples[None])
        samples = signed(str(path), scan.parameter(parameter), self._mapping) * scale
        return finished(str(path), samples, sweep.frequencies, np.zeros((1, 3)), self._mapping)

    def _parameter(self, name: str, *tables: SamplesTable) -> str:
        for table in tables:
            if table.parameter is not None:
                return table.parameter
        raise MeasurementError(
            f'{self._source}: {name}.parameter is missing; give the S-parameter, as "S21"'
        )


def finished(
    name: str,
    samples: Samples,
    frequencies: Frequencies,
    positions: Positions,
    mapping: SweepMapping,
    *,
    leave_out: Sequence[int] = (),
    transmit_positions: Positions | None = None,
    notes: tuple[str, ...] = (),
) -> Signal:
    """Return a signal without unmeasured positions, over rising, equally spaced frequencies.

    Parameters
    ----------
    name
        File and table, for messages.
    samples
        In the convention exp(+jωt); a position that was not measured is NaN throughout.
    frequencies
        Rising or falling. [Hz]
    positions, transmit_positions
        Where the antennas stood. [m]
    mapping
        The band, and what is known of the frequencies.
    leave_out
        Positions to leave out, by their number.
    notes
        Earlier remarks.

    Raises
    ------
    MeasurementError
        If some but not all samples of a position are missing, too many positions are missing, or
        the frequencies cannot be converted to equal steps.
    """
    keep, dead = measured_positions(name, samples, leave_out)
    found = ordered_sweep(name, samples[keep], frequencies, mapping)
    return Signal(
        samples=found.samples,
        frequencies=found.frequencies,
        positions=positions[keep],
        transmit_positions=None if transmit_positions is None else transmit_positions[keep],
        notes=(*notes, *dead, *found.notes),
    )


def measured_positions(
    name: str, samples: Num[np.ndarray, "positions points"], leave_out: Sequence[int]
) -> tuple[Bool[np.ndarray, " positions"], tuple[str, ...]]:
    """Tell which positions were measured, and remark those that were not.

    Raises
    ------
    MeasurementError
        If a number in `leave_out` is not a position's, some but not all samples of a position are
        missing, or more than the share :data:`MOST_MISSING` of the positions is empty.
    """
    count = len(samples)
    beyond = [number for number in leave_out if number >= count]
    if beyond:
        raise MeasurementError(
            f"{name}: leave_out = {beyond[0]}, but there are {count} positions, counted from 0"
        )
    kept = np.ones(count, dtype=bool)
    kept[list(leave_out)] = False
    missing = np.isnan(samples)
    dead = kept & missing.all(axis=1)
    partly = np.flatnonzero(kept & ~dead & missing.any(axis=1))
    if partly.size:
        raise MeasurementError(
            f"{name}: {np.count_nonzero(missing[kept])} of {samples.size} values are NaN, infinite "
            f"or missing (position {partly[0]} in part); measure again, or set leave_out = "
            f"{partly[:SHOWN].tolist()}"
        )
    numbers = np.flatnonzero(dead)
    if numbers.size > MOST_MISSING * count or not np.any(kept & ~dead):
        raise MeasurementError(
            f"{name}: {numbers.size} of {count} positions hold no number (NaN); at most "
            f"{MOST_MISSING:.0%} are left out by themselves: measure again, or set leave_out = "
            f"{numbers[:SHOWN].tolist()} …"
        )
    if not numbers.size:
        return kept, ()
    shown = ", ".join(map(str, numbers[:SHOWN])) + (", …" if numbers.size > SHOWN else "")
    return kept & ~dead, (
        f"{name}: {numbers.size} of {count} positions hold no number (NaN) and were left out "
        f"(counted from 0: {shown})",
    )


def signed(name: str, values: np.ndarray, mapping: SweepMapping) -> np.ndarray:
    """Return samples in the convention exp(+jωt); refuse impossible magnitudes."""
    check_samples(name, values)
    return np.conj(values) if mapping.time_convention == "exp(-jwt)" else values


def check_places(
    name: str,
    positions: Positions,
    highest: float,
    table: PositionTable,
    *,
    counted: bool = False,
) -> tuple[str, ...]:
    """Refuse an implausible size or spacing of the array, judged at its highest frequency [Hz]."""
    note = check_positions(
        name,
        positions,
        speed_of_light / highest,
        any_size=table.any_size,
        counted=counted,
        remedy=f"[positions] unit = {table.unit!r} may be wrong; if it is not, set any_size = true",
    )
    return () if note is None else (note,)
