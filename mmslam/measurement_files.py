"""Measurement files: read, written, and made of somebody else's data."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimator.measurement.model import MeasurementError
from estimator.measurement.store import read_measurement, write_measurement
from mmslam import output, own_results
from mmslam.formats.export_touchstone import MAPPING, export_touchstone, refuse_foreign_touchstone
from mmslam.formats.import_full_wave import import_npz
from mmslam.formats.import_measured import import_measured as import_by_mapping
from mmslam.formats.mapping import checked_mapping, load_mapping
from mmslam.measurement import Measurement, TruthFile


def read(path: str | Path, *, sample: int | None = None) -> Measurement:
    """Read a measurement file, or one sample of a dataset.

    Parameters
    ----------
    path
        The store.
    sample
        Which one, if the store is a dataset.

    Returns
    -------
    The measurement. Its truth, if the store holds any, is opened when it is first asked for.

    Raises
    ------
    MeasurementError
        If the store is missing, foreign or damaged; the message says what and where.

    Examples
    --------
    >>> import mmslam
    >>> room = mmslam.load_scenario(
    ...     "point_scatterers", {"base_station.elements": 16, "radio.points": 16}
    ... )
    >>> mmslam.write("room.zarr", mmslam.simulate(room, seed=1))
    >>> mmslam.read("room.zarr")
    point_scatterers, seed 1: echo
    positions    16 over 7.5 mm
    frequencies  16 from 220 to 295 GHz
    clock        shared
    truth        beside it
    """
    measurement = read_measurement(Path(path), sample=sample)
    return Measurement.of(measurement, beside=TruthFile(store=Path(path), sample=sample))


def write(path: str | Path, measurement: Measurement) -> None:
    """Write a measurement to a file, and beside it the truth, if it is known.

    Parameters
    ----------
    path
        The store; an earlier one is replaced, anything else refused.
    measurement
        What is written.

    Raises
    ------
    OutputError
        If something else is at ``path``, or it cannot be written; nothing is left behind then.

    Examples
    --------
    >>> import numpy as np
    >>> import mmslam
    >>> own = mmslam.Measurement.from_arrays(
    ...     frequencies=np.linspace(220e9, 221e9, 5),
    ...     positions=np.arange(4) * 0.5e-3,
    ...     echo=np.ones((4, 5)),
    ... )
    >>> mmslam.write("own.zarr", own)
    >>> mmslam.read("own.zarr").echo.samples.shape
    (4, 5)
    """
    with output.replacing(Path(path), own_results.refuse_foreign_store) as new:
        proper = measurement.without_truth()
        write_measurement(new, proper, truth=measurement.truth_dataset)


def import_measured(
    source: str | Path,
    mapping: str | Path | Mapping[str, Any] | None = None,
    *,
    uplink: str | None = None,
) -> Measurement:
    """Read measured data: a folder of Touchstone files, or a MATLAB, HDF5, CSV or NumPy file.

    Parameters
    ----------
    source
        The folder or file.
    mapping
        Says what in it is what: a TOML file, or its tables. None: ``mapping.toml`` in the folder,
        if there is one; else ``source`` is a full-wave reference (an .npz of `echo`,
        `aperture_position`, `frequency`, `uplink_…`), its truth included.
    uplink
        Which pilot of a full-wave reference; None: ``uplink_beam``, else the first.

    Returns
    -------
    The measurement; its notes say what looked odd in the data.

    Raises
    ------
    MeasurementError
        If something is missing, damaged or implausible; the message names the file, the value,
        the limit and the remedy.

    Examples
    --------
    >>> import numpy as np
    >>> import mmslam
    >>> rng = np.random.default_rng(0)
    >>> s11 = 1e-3 * (rng.normal(size=(4, 5)) + 1j * rng.normal(size=(4, 5)))
    >>> np.savez("sweep.npz", s11=s11, x=np.arange(4.0), f=np.linspace(220, 221, 5))
    >>> mapping = {
    ...     "frequency": {"unit": "GHz", "variable": "f"},
    ...     "positions": {"unit": "mm", "x": "x"},
    ...     "echo": {"variable": "s11", "axes": ["position", "frequency"]},
    ... }
    >>> mmslam.import_measured("sweep.npz", mapping).echo.positions[:, 0]
    array([0.   , 0.001, 0.002, 0.003])
    """
    source = Path(source)
    mapping = mapping if mapping is not None else mapping_beside(source)
    if mapping is None:
        return _full_wave(source, uplink)
    if uplink is not None:
        raise MeasurementError("uplink is for data without a mapping; leave it out")
    if isinstance(mapping, Mapping):
        found = import_by_mapping(source, checked_mapping(mapping), base=Path.cwd())
    else:
        path = Path(mapping)
        found = import_by_mapping(source, load_mapping(path), base=path.parent)
    return Measurement.of(found.measurement, notes=found.notes)


def _full_wave(source: Path, uplink: str | None) -> Measurement:
    if source.is_dir() or (source.exists() and source.suffix.lower() != ".npz"):
        raise MeasurementError(
            f"{source}: measured data needs a mapping (--mapping FILE.toml); its keys are listed "
            "by `mmslam import --schema`"
        )
    imported = import_npz(source, uplink=uplink)
    return Measurement.of(imported.measurement, beside=imported.truth)


def import_to_file(
    source: Path, *, mapping: Path | None, uplink: str | None, path: Path
) -> Measurement:
    """Convert other data to a measurement store; ``path`` is refused before any work."""
    with output.replacing(path, own_results.refuse_foreign_store) as new:
        imported = import_measured(source, mapping, uplink=uplink)
        write(new, imported)
    return imported


def mapping_beside(source: Path) -> Path | None:
    """Return the mapping file that lies in a folder of measured data, if one does."""
    beside = source / MAPPING
    return beside if beside.is_file() else None


def export_to_touchstone(source: Path, *, sample: int | None, folder: Path) -> int:
    """Write a measurement store as a folder of Touchstone files; return their number."""
    measurement = read_measurement(source, sample=sample)
    with output.replacing(folder, refuse_foreign_touchstone) as new:
        return export_touchstone(measurement, new)
