"""Import of measured data into measurement files, and export to other formats."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimator.measurement.model import MeasurementError
from estimator.measurement.store import read_measurement
from mmslam import output, own_results
from mmslam.formats.export_touchstone import MAPPING, export_touchstone, refuse_foreign_touchstone
from mmslam.formats.import_full_wave import import_npz
from mmslam.formats.import_measured import import_measured as import_by_mapping
from mmslam.formats.mapping import checked_mapping, load_mapping
from mmslam.measurement import Measurement
from mmslam.measurement_files import write


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
        Describes the data (variables, axes, units): a TOML file, or its tables. None:
        ``mapping.toml`` in the folder, if there is one; else ``source`` is a full-wave reference
        (an .npz of `echo`, `aperture_position`, `frequency`, `uplink_…`), its truth included.
    uplink
        Which pilot of a full-wave reference; None: ``uplink_beam``, else the first.

    Returns
    -------
    The measurement; its notes name implausible data.

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
