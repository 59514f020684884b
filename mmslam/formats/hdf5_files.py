"""Arrays from HDF5, NetCDF-4 and MATLAB 7.3 files, which all are HDF5.

A link to another file, raw data kept in another file, and a virtual dataset are refused: a
file from elsewhere could otherwise have any file of this machine read as samples.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from estimator.measurement.model import MeasurementError

SIGNATURE = b"\x89HDF\r\n\x1a\n"

COMPLEX_PARTS = (("real", "imag"), ("r", "i"), ("re", "im"), ("Re", "Im"))
"""Names of the parts of complex numbers that programs are known to write."""


def is_hdf5(path: Path) -> bool:
    """Tell whether a file is HDF5; MATLAB puts 512 bytes before its signature."""
    with path.open("rb") as stream:
        head = stream.read(4096)
    return any(head.startswith(SIGNATURE, at) for at in (0, 512, 1024, 2048))


def hdf5_array(
    path: Path, name: str, *, largest: int, matlab_classes: tuple[str, ...] | None = None
) -> np.ndarray:
    """Read one dataset of numbers.

    Parameters
    ----------
    path
        The file.
    name
        The dataset's path, groups separated by ``/``.
    largest
        The most values that are read.
    matlab_classes
        Of a MATLAB file: its classes that are accepted. The axes are then turned round, as
        MATLAB shows them.

    Raises
    ------
    MeasurementError
        If there is no such dataset, it holds no numbers, or lies outside the file.
    """
    import h5py  # type: ignore[import-untyped]  # takes a third of a second

    try:
        with h5py.File(path, "r") as file:
            dataset = _dataset(h5py, path, file, name)
            if dataset.size is None or dataset.size > largest:
                raise MeasurementError(
                    f"{path}: {name!r} has shape {dataset.shape}; it must hold numbers, at most "
                    f"{largest} of them: thin it out, or import in parts"
                )
            kind = dataset.attrs.get("MATLAB_class", b"double")
            kind = kind.decode(errors="replace") if isinstance(kind, bytes) else str(kind)
            if matlab_classes is not None and kind not in matlab_classes:
                raise MeasurementError(
                    f"{path}: {name!r} is a MATLAB {kind}; only arrays of numbers are read: save "
                    "it as a plain array"
                )
            values = _decoded(dataset, _numbers(path, name, dataset[()]))
    except MeasurementError:
        raise
    except Exception as error:  # HDF5 fails in many ways on a damaged file
        raise MeasurementError(_damaged(path, error)) from error
    return values if matlab_classes is None else values.T


def hdf5_attribute(path: Path, key: str) -> float | None:
    """Read one number among the attributes of the whole file; None if there is no such number.

    Raises
    ------
    MeasurementError
        If the file is damaged, or no HDF5.
    """
    import h5py  # takes a third of a second

    try:
        with h5py.File(path, "r") as file:
            if key not in file.attrs:
                return None
            kept = file.attrs.get_id(key)
            if kept.shape not in ((), (1,)) or kept.dtype.kind not in "iuf":
                return None
            return float(np.asarray(file.attrs[key]).ravel()[0])
    except Exception as error:  # HDF5 fails in many ways on a damaged file
        raise MeasurementError(_damaged(path, error)) from error


def _damaged(path: Path, error: Exception) -> str:
    return (
        f"{path}: cannot be read as HDF5 ({type(error).__name__}: {error}); it may be "
        "truncated: copy it again"
    )


def _dataset(h5py: Any, path: Path, file: Any, name: str) -> Any:
    place = file
    for part in [part for part in name.split("/") if part]:
        link = place.get(part, getlink=True) if isinstance(place, h5py.Group) else None
        if link is None:
            found = ", ".join(sorted(_names(h5py, file))[:20]) or "none"
            raise MeasurementError(f"{path}: no dataset {name!r} (found: {found}); choose one")
        if not isinstance(link, h5py.HardLink):
            raise MeasurementError(
                f"{path}: {name!r} is a link ({type(link).__name__}), perhaps to another file; "
                "copy the data into this file"
            )
        place = place[part]
    if not isinstance(place, h5py.Dataset):
        raise MeasurementError(f"{path}: {name!r} is a group; name a dataset in it")
    if place.external or place.is_virtual:
        raise MeasurementError(
            f"{path}: the data of {name!r} lies in another file; copy it into this one"
        )
    return place


def _names(h5py: Any, group: Any, prefix: str = "") -> Iterator[str]:
    for part in group:
        if not isinstance(group.get(part, getlink=True), h5py.HardLink) or part.startswith("#"):
            continue
        if isinstance(group[part], h5py.Dataset):
            yield prefix + part
        elif prefix.count("/") < 4:
            yield from _names(h5py, group[part], f"{prefix}{part}/")


def _numbers(path: Path, name: str, values: Any) -> np.ndarray:
    array = np.asarray(values)
    if array.dtype.kind == "V" and array.dtype.names in COMPLEX_PARTS:
        real, imaginary = (array[part] for part in array.dtype.names)
        array = real + 1j * imaginary
    if array.dtype.kind not in "iufc":
        raise MeasurementError(
            f"{path}: {name!r} holds {array.dtype}; only arrays of numbers are read"
        )
    return array


def _decoded(dataset: Any, values: np.ndarray) -> np.ndarray:
    """Undo what NetCDF packs: missing values, factor and offset (CF conventions, 2.5.1, 8.1)."""
    missing = np.zeros(values.shape, dtype=bool)
    for key in ("_FillValue", "missing_value"):
        if key in dataset.attrs and values.dtype.kind != "c":
            missing |= values == np.asarray(dataset.attrs[key]).ravel()[0]
    factor = float(np.asarray(dataset.attrs.get("scale_factor", 1.0)).ravel()[0])
    offset = float(np.asarray(dataset.attrs.get("add_offset", 0.0)).ravel()[0])
    if factor != 1.0 or offset != 0.0:
        values = values * factor + offset
    return np.where(missing, np.nan, values) if missing.any() else values
