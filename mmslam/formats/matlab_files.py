"""Arrays from MATLAB files: versions 4 to 7 by SciPy, 7.3 as HDF5. Objects are refused."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from estimator.measurement.model import MeasurementError
from mmslam.formats.hdf5_files import hdf5_array, is_hdf5
from mmslam.formats.matlab_elements import check_elements

_INTEGERS = ("int8", "int16", "int32", "int64")
NUMBERS = ("double", "single", *_INTEGERS, *(f"u{kind}" for kind in _INTEGERS))
"""MATLAB's classes that are arrays of numbers."""


def matlab_array(path: Path, name: str, *, largest: int) -> np.ndarray:
    """Read one array of numbers, its axes in MATLAB's order.

    Parameters
    ----------
    path
        The .mat file.
    name
        The variable; the field of a structure after a dot.
    largest
        The most values that are read.

    Raises
    ------
    MeasurementError
        If there is no such variable, it is no array of numbers, or the file is damaged.
    """
    if is_hdf5(path):
        return hdf5_array(path, name.replace(".", "/"), largest=largest, matlab_classes=NUMBERS)
    variable, *fields = name.split(".")
    from scipy.io import loadmat, whosmat

    check_elements(path)
    try:
        listed = {found[0]: (found[1], found[2]) for found in whosmat(path)}
        _check_listed(path, variable, fields, listed, largest)
        values: object = loadmat(path, variable_names=[variable])[variable]
    except MeasurementError:
        raise
    except Exception as error:  # SciPy fails in many ways on a damaged file
        raise MeasurementError(
            f"{path}: cannot be read as a MATLAB file ({type(error).__name__}: {error}); it may "
            "be truncated or of another kind: save it again"
        ) from error
    for field in fields:
        values = _field(path, name, field, values)
    array = np.asarray(values)
    if array.dtype.kind not in "iufc":
        raise MeasurementError(f"{path}: {name!r} is no array of numbers; save it as a plain array")
    return array


def _check_listed(
    path: Path,
    variable: str,
    fields: list[str],
    listed: Mapping[str, tuple[tuple[int, ...], str]],
    largest: int,
) -> None:
    if variable not in listed:
        found = ", ".join(sorted(listed)) or "nothing"
        raise MeasurementError(f"{path}: no variable {variable!r} (found: {found}); choose one")
    shape, kind = listed[variable]
    if kind not in (("struct",) if fields else NUMBERS):
        remedy = (
            f"name one of its fields, as {variable}.S21"
            if kind == "struct"
            else "in MATLAB, save it as a plain (full) array of doubles"
        )
        raise MeasurementError(
            f"{path}: {variable!r} is a MATLAB {kind}; only arrays of numbers are read: {remedy}"
        )
    if np.prod(shape, dtype=float) > largest:
        raise MeasurementError(
            f"{path}: {variable!r} has shape {shape}, more than {largest} values: thin it out, or "
            "import in parts"
        )


def _field(path: Path, name: str, field: str, values: object) -> object:
    structure = np.asarray(values)
    if structure.dtype.names is None or structure.size != 1:
        raise MeasurementError(f"{path}: {name!r}: no single structure holds {field!r}")
    if field not in structure.dtype.names:
        found = ", ".join(structure.dtype.names)
        raise MeasurementError(f"{path}: {name!r}: no field {field!r} (found: {found})")
    return structure[field].ravel()[0]
