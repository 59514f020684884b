"""Import of measured data of any layout, described by a mapping file.

The order of the steps: read; bring to exp(+jωt); subtract the background; divide the radio's
response out; take the cables' delay out. The steps are those of
:mod:`estimator.measurement.calibration`.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.measurement.calibration import equalise, remove_path, subtract_background
from estimator.measurement.constant_signal import (
    PROPOSED_DB,
    shared_signal,
    without_delays,
    without_shared_signal,
)
from estimator.measurement.model import Echo, Measurement, MeasurementError, PathList, Uplink
from mmslam.formats.array_reader import FILES, ArrayReader
from mmslam.formats.checks.autofocused import autofocused
from mmslam.formats.checks.boresight import boresight_of
from mmslam.formats.checks.focus_check import delay_by_focus, focus_notes
from mmslam.formats.mapping import SweepMapping
from mmslam.formats.measured_signals import (
    FolderReader,
    Positions,
    Signal,
    SignalReader,
    told,
)
from mmslam.formats.path_lists import import_path_lists
from mmslam.formats.plausibility import sign_note, strength_note
from mmslam.formats.tables.signal_tables import EchoTable, SignalTable
from mmslam.formats.touchstone_files import SUFFIX

Data = TypeVar("Data", Echo, Uplink)


@dataclass(frozen=True, kw_only=True)
class Import:
    """A measurement, and remarks on implausible data."""

    measurement: Measurement
    notes: tuple[str, ...]


def import_measured(source: Path, mapping: SweepMapping, *, base: Path) -> Import:
    """Read measured data.

    Parameters
    ----------
    source
        A folder of Touchstone files or of one array or CSV file for each position, or one file.
    mapping
        Describes the data: variables, axes, units and sign convention.
    base
        Folder to which the mapping's file names are relative.

    Raises
    ------
    MeasurementError
        If something is missing, damaged, inconsistent or implausible; the message names the
        file, the value, the limit and the remedy.
    """
    if not source.exists():
        raise MeasurementError(f"{source}: no such file or folder")
    if source.is_file() and SUFFIX.search(source.name):
        raise MeasurementError(
            f"{source}: one Touchstone file is one position; give the folder of all of them"
        )
    lists: tuple[PathList, ...] = ()
    if mapping.paths is not None:
        lists = import_path_lists(source, mapping.paths, base)
        if not mapping.signals():
            return _lists_alone(source, mapping, lists)
    reader: SignalReader = (
        FolderReader(source, mapping, base)
        if source.is_dir() and not _holds_arrays(mapping)
        else ArrayReader(source, mapping, base)
    )
    notes: list[str] = []
    stepped = mapping.time is None and mapping.chirp is None
    if mapping.refractive_index != 1.0:
        notes.append(
            f"{source}: in a medium of refractive index {mapping.refractive_index:g}: lengths are "
            "the medium's"
        )
    given = np.array(mapping.boresight) if "boresight" in mapping.model_fields_set else None
    boresight, remark = None, None
    echo = None
    if mapping.echo is not None:
        found = reader.signal("echo", mapping.echo)
        transmitters = _transmitters(reader, mapping.echo, found)
        with told(source):
            raw: Echo = Echo(
                samples=found.samples,
                positions=found.positions,
                frequencies=found.frequencies,
                transmit_positions=transmitters,
            )
        boresight, remark = boresight_of(str(source), raw.positions, given)
        echo = _calibrated(reader, raw, mapping.echo, "echo", boresight)
        if mapping.echo.autofocus:
            with told(f"{source}: echo.autofocus"):
                echo, refocused = autofocused(echo, boresight)
            notes.append(f"{source}: echo: {refocused}")
        notes += focus_notes(f"{source}: echo", echo, boresight, clock_known=True)
        notes += _notes(source, "echo", echo, found, stepped=stepped)
    uplinks = []
    for user, table in mapping.uplinks.items():
        name = f"uplinks.{user}"
        found = reader.signal(name, table)
        with told(source):
            pilot = Uplink(
                samples=found.samples,
                positions=found.positions,
                frequencies=found.frequencies,
                user=user,
            )
        if boresight is None:
            boresight, remark = boresight_of(str(source), pilot.positions, given)
        pilot = _calibrated(reader, pilot, table, name, boresight)
        notes += focus_notes(
            f"{source}: {name}", pilot, boresight, clock_known=mapping.clock_offset_ns is not None
        )
        notes += _notes(source, name, pilot, found, stepped=stepped)
        uplinks.append(pilot)
    assert boresight is not None  # a mapping without any signal is refused
    notes += [] if remark is None else [remark]
    clock = mapping.clock_offset_ns
    with told(source):
        measurement = Measurement(
            echo=echo,
            uplinks=tuple(uplinks),
            waves=mapping.waves,
            boresight=boresight,
            clock_offset=None if clock is None else clock / 1e9,
            scenario=mapping.scenario or source.resolve().stem,
            path_lists=lists,
            **mapping.medium(),
        )
    return Import(measurement=measurement, notes=tuple(dict.fromkeys(notes)))


def _lists_alone(source: Path, mapping: SweepMapping, lists: tuple[PathList, ...]) -> Import:
    clock = mapping.clock_offset_ns
    measurement = Measurement(
        echo=None,
        uplinks=(),
        boresight=np.array(mapping.boresight),
        clock_offset=None if clock is None else clock / 1e9,
        scenario=mapping.scenario or source.resolve().stem,
        path_lists=lists,
        **mapping.medium(),
    )
    return Import(measurement=measurement, notes=())


def _holds_arrays(mapping: SweepMapping) -> bool:
    """Tell whether a folder holds files of arrays or text, by what the mapping says of them."""
    signals = mapping.signals().values()
    if any(table.parameter is not None for table in signals):
        return False
    patterns = [mapping.positions_of(table).files for table in signals]
    return any(pattern is not None and FILES.search(pattern) for pattern in patterns) or any(
        table.names_samples() or table.raw is not None for table in signals
    )


def _transmitters(reader: SignalReader, table: EchoTable, found: Signal) -> Positions | None:
    if table.transmit_positions is not None:
        return reader.transmitters(table.transmit_positions, len(found.positions))
    if table.transmit_offset_m is not None:
        return np.asarray(found.positions + np.array(table.transmit_offset_m))
    return found.transmit_positions


def _calibrated(
    reader: SignalReader,
    data: Data,
    table: SignalTable,
    name: str,
    boresight: Float[np.ndarray, " 3"],
) -> Data:
    if table.background is not None:
        empty = reader.background(name, table, table.background)
        same = empty.positions.shape == data.positions.shape and len(data.positions) > 1
        samples, positions = empty.samples, empty.positions
        if len(samples) == 1 and not same:  # one sweep serves all positions
            samples = np.broadcast_to(samples, (len(data.positions), samples.shape[1]))
            positions = data.positions
        elif len(positions) > len(data.positions):  # some of ours were left out
            kept = np.array([(row == data.positions).all(axis=1).any() for row in positions])
            samples, positions = samples[kept], positions[kept]
        with told(f"{name}.background"):
            background = replace(
                data, samples=samples, positions=positions, frequencies=empty.frequencies
            )
            data = subtract_background(data, background)
    if table.response is not None:
        through = reader.response(name, table, table.response)
        with told(f"{name}.response"):
            if not np.array_equal(through.frequencies, data.frequencies):
                raise MeasurementError(
                    "its frequencies differ from the measurement's; measure both on one grid"
                )
            data = equalise(data, through.samples[0], phase_only=table.response.phase_only)
    if table.cable_delay_ns != "focus":
        # The delay in air has the same phase: l = τ·c.
        data = remove_path(data, table.cable_delay_ns * 1e-9 * speed_of_light)
    if table.subtract_shared is not None:
        shared = table.subtract_shared
        with told(f"{name}.subtract_shared"):
            data = without_shared_signal(data, components=None if shared == "mean" else shared)
    if table.gate_out_ns is not None:
        with told(f"{name}.gate_out_ns"):
            first, last = (1e-9 * one for one in table.gate_out_ns)
            data = without_delays(data, first, last)
    if table.cable_delay_ns == "focus":
        with told(f"{name}.cable_delay_ns"):
            data = remove_path(data, delay_by_focus(data, boresight))
    return data


def _notes(
    source: Path, name: str, data: Echo | Uplink, found: Signal, *, stepped: bool
) -> list[str]:
    notes = [
        # The spectrum of a trace has the unit of its samples, times their number.
        strength_note(f"{source}: {name}", data.samples) if stepped else None,
    ]
    if stepped:
        notes.append(sign_note(f"{source}: {name}", data.samples, data.frequencies))
    if isinstance(data, Echo):
        notes.append(_shared_note(f"{source}: {name}", data))
    return [*found.notes, *(note for note in notes if note is not None)]


def _shared_note(name: str, data: Echo) -> str | None:
    """Propose to subtract the signal common to all positions if it is far above the rest."""
    shared = shared_signal(data)
    if shared is None or shared.above_rest_db < PROPOSED_DB:
        return None
    return (
        f"{name}: all positions share one constant, {shared.above_rest_db:.0f} dB above the rest, "
        f"with the delay of a path of {shared.path:.3g} m there and back: an antenna's mismatch, a "
        'leak or an offset, or a plate that faces all of them; set subtract_shared = "mean" to '
        "see what is behind it"
    )
