"""A measurement as Touchstone files, a folder for each signal, with the mapping that reads them.

Numbers are written so that reading gives the same doubles: importing the folder again gives the
same measurement, bit for bit (but for its seed, and for a truth, which is not exported).
"""

import csv
import io
from dataclasses import asdict
from pathlib import Path

import numpy as np
from jaxtyping import Float

from estimator.measurement.model import Echo, Measurement, Uplink
from mmslam.formats.touchstone_files import touchstone_text
from mmslam.formats.touchstone_folder import COORDINATES, TRANSMIT_COORDINATES
from scenes.files.toml_writer import toml_text

MAPPING = "mapping.toml"
"""Name of the mapping file in the folder; `mmslam import` looks for it there."""

LIST = "positions.csv"
MARK = "# Written by `mmslam export`"

_ECHO = "echo"


def export_touchstone(measurement: Measurement, folder: Path) -> int:
    """Write a measurement as Touchstone files into a new folder.

    The echo of one antenna is S11 of one-ports. A pilot, and the echo of a transmitter that
    stands apart, are S21 (and S12) of two-ports, whose S11 and S22 are 0: they were not measured.

    Parameters
    ----------
    measurement
        What is written.
    folder
        Where; it must not exist yet.

    Returns
    -------
    How many Touchstone files were written.
    """
    folder.mkdir(parents=True)
    mapping: dict[str, object] = {
        "waves": measurement.waves,
        "boresight": measurement.boresight.tolist(),
        "clock_offset_ns": None
        if measurement.clock_offset is None
        else measurement.clock_offset * 1e9,
        "scenario": measurement.scenario,
        "refractive_index": measurement.medium_index,
        "air": None if measurement.air is None else asdict(measurement.air),
    }
    count = 0
    if echo := measurement.echo:
        ports = 1 if echo.transmit_positions is None else 2
        count += _write(folder / _ECHO, echo, ports, echo.transmit_positions)
        mapping["echo"] = _table(_ECHO, ports)
    uplinks: dict[str, object] = {}
    for number, uplink in enumerate(measurement.uplinks):
        name = f"uplink_{number}"  # a user's name may hold what a file's must not
        count += _write(folder / name, uplink, 2, None)
        uplinks[uplink.user] = _table(name, 2)
    if uplinks:
        mapping["uplinks"] = uplinks
    text = f"{MARK}; `mmslam import` reads this folder by it.\n\n{toml_text(mapping)}"
    (folder / MAPPING).write_text(text, encoding="utf-8")
    return count


def refuse_foreign_touchstone(folder: Path) -> str | None:
    """Say why a folder may not be replaced by a new export; None if it is one of ours."""
    if not any(folder.iterdir()):
        return None
    try:
        ours = (folder / MAPPING).read_text(encoding="utf-8").startswith(MARK)
    except (OSError, UnicodeDecodeError):
        ours = False
    return None if ours else f"no {MAPPING} in it says that mmslam exported it"


def _table(name: str, ports: int) -> dict[str, object]:
    return {
        "folder": name,
        "parameter": "S11" if ports == 1 else "S21",
        "positions": {"csv": f"{name}/{LIST}", "unit": "m"},
    }


def _write(
    folder: Path,
    data: Echo | Uplink,
    ports: int,
    transmit_positions: Float[np.ndarray, "positions 3"] | None,
) -> int:
    folder.mkdir()
    columns = ["file", *COORDINATES]
    rows = data.positions.tolist()
    if transmit_positions is not None:
        columns += TRANSMIT_COORDINATES
        rows = [row + other for row, other in zip(rows, transmit_positions.tolist(), strict=True)]
    listed = io.StringIO(newline="")
    writer = csv.writer(listed, lineterminator="\n")
    writer.writerow(columns)
    for index, (row, spectrum) in enumerate(zip(rows, data.samples, strict=True)):
        name = f"{index:05d}.s{ports}p"
        place = ", ".join(map(str, row[:3]))
        text = touchstone_text(
            data.frequencies, spectrum, ports=ports, comment=f"antenna at {place} [m]"
        )
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
        writer.writerow([name, *map(repr, row)])
    (folder / LIST).write_text(listed.getvalue(), encoding="utf-8", newline="\n")
    return len(rows)
