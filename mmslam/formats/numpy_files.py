"""Arrays from NumPy's own files; a pickled object in one is never loaded."""

import math
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from estimator.measurement.model import MeasurementError
from scenes.files.toml_reader import is_file

LARGEST = 2**28
"""Most values of all arrays that are read, unless told otherwise."""

_WIDEST = 16  # bytes of a complex number


def npz_arrays(
    path: Path, *, only: str | None = None, largest: int = LARGEST
) -> dict[str, np.ndarray]:
    """Read the arrays of an .npz archive, or the one of them that is asked for.

    Parameters
    ----------
    path
        The archive.
    only
        The one array that is read; None: all.
    largest
        The most values that are read.

    Raises
    ------
    MeasurementError
        If it is no archive, is damaged, or holds pickled objects.
    """
    if not is_file(path):
        raise MeasurementError(f"{path}: no such file")
    if not zipfile.is_zipfile(path):
        raise MeasurementError(
            f"{path}: not a NumPy .npz archive; write one with numpy.savez_compressed"
        )
    arrays = {}
    try:
        with zipfile.ZipFile(path) as packed:
            promised = sum(
                entry.file_size
                for entry in packed.infolist()
                if only is None or entry.filename == f"{only}.npy"
            )
        if promised > _WIDEST * largest:
            raise MeasurementError(
                f"{path}: {promised} bytes unpacked, more than {_WIDEST * largest}: thin it out, "
                "or import in parts"
            )
        with np.load(path, allow_pickle=False) as archive:
            for name in archive.files:
                if only is None or name == only:
                    arrays[name] = _array(path, name, archive[name])
            if only is not None and only not in arrays:
                found = ", ".join(sorted(archive.files)) or "nothing"
                raise MeasurementError(f"{path}: no array {only!r} (found: {found}); choose one")
    except MeasurementError:
        raise
    except Exception as error:  # zip, codecs and NumPy fail in many ways on a damaged file
        raise _pickled_or_damaged(path, error) from error
    return arrays


def _array(path: Path, name: str, found: object) -> np.ndarray:
    if not isinstance(found, np.ndarray):  # NumPy gives the bytes of any other member
        raise MeasurementError(
            f"{path}: {name!r} is no array; write the archive with numpy.savez_compressed"
        )
    return found


def npy_array(path: Path, name: str | None = None, *, largest: int = LARGEST) -> np.ndarray:
    """Read the array of an .npy file, or one of several that were saved one after another.

    Parameters
    ----------
    path
        The file.
    name
        Which of several: "0" is the first; None: the only one.
    largest
        The most values that are read.

    Raises
    ------
    MeasurementError
        If it is none, is damaged, holds pickled objects, or has no such array.
    """
    if name is not None and not (name.isascii() and name.isdigit() and len(name) < 4):
        raise MeasurementError(
            f"{path}: an .npy file holds arrays without names; leave variable out, or give the "
            f'number of one of several, as "0" (found: {name!r})'
        )
    wanted = int(name or "0")
    try:
        with path.open("rb") as stream:
            size = path.stat().st_size
            for _ in range(wanted):
                shape, kind = _npy_header(stream)
                stream.seek(_bytes_of(shape, kind), 1)
                if stream.tell() >= size:
                    raise MeasurementError(f"{path}: no array {wanted}; choose a lower number")
            at = stream.tell()
            promised = _bytes_of(*_npy_header(stream))
            if promised > min(size - stream.tell(), _WIDEST * largest):
                raise MeasurementError(
                    f"{path}: its header promises {promised} bytes, the file holds "
                    f"{size - stream.tell()} and at most {_WIDEST * largest} are read; it may be "
                    "truncated: copy it again"
                )
            stream.seek(at)
            values = np.asarray(np.lib.format.read_array(stream, allow_pickle=False))
            if name is None and stream.tell() < size:
                raise MeasurementError(
                    f"{path}: another array follows the first, of shape {values.shape}; give "
                    'variable = "0" for the first, "1" for the second'
                )
            return values
    except MeasurementError:
        raise
    except Exception as error:  # NumPy fails in many ways on a damaged header
        raise _pickled_or_damaged(path, error) from error


def _npy_header(stream: BinaryIO) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, _, kind = np.lib.format.read_array_header_1_0(stream)
    else:
        shape, _, kind = np.lib.format.read_array_header_2_0(stream)
    if kind.hasobject:
        raise ValueError("Object arrays would need pickle")
    return shape, kind


def _bytes_of(shape: tuple[int, ...], kind: np.dtype[Any]) -> int:
    return math.prod(shape) * kind.itemsize


def _pickled_or_damaged(path: Path, error: Exception) -> MeasurementError:
    if "pickle" in str(error):  # what NumPy says of an array of objects
        return MeasurementError(
            f"{path}: {error}; pickled objects are never loaded, store plain arrays of numbers "
            "instead"
        )
    return MeasurementError(
        f"{path}: cannot be read ({error}); it may be truncated or of another kind: copy it again"
    )
