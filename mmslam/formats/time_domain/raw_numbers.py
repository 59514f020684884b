"""Raw numbers without a header, from recorders of radar chips; the mapping gives the layout."""

import math
from pathlib import Path

import numpy as np

from estimator.measurement.model import MeasurementError
from mmslam.formats.tables.signal_tables import LARGEST_SHAPE, RawTable
from scenes.files.toml_reader import is_file


def raw_array(path: Path, name: str, table: RawTable) -> np.ndarray:
    """Read a file of bare numbers.

    Parameters
    ----------
    path
        The file.
    name
        The mapping's table, for messages.
    table
        The kind of its numbers, their number along each axis, and how I and Q follow each other.

    Raises
    ------
    MeasurementError
        If the size of the file does not agree with the layout.
    """
    if not is_file(path):
        raise MeasurementError(f"{path}: no such file; correct its name in the mapping")
    kind = np.dtype(table.type).newbyteorder(">" if table.big_endian else "<")
    paired = table.pairs != "none"
    count = math.prod(table.shape) * (2 if paired else 1)
    size, needed = path.stat().st_size, table.header_bytes + count * kind.itemsize
    if size != needed or count > 2 * LARGEST_SHAPE:
        raise MeasurementError(
            f"{path}: {size} bytes, but {name}.raw.shape = {table.shape} of {table.type} "
            f"{'pairs ' if paired else ''}after {table.header_bytes} bytes makes {needed} (at most "
            f"{2 * LARGEST_SHAPE} numbers); correct shape, type, pairs or header_bytes"
        )
    numbers = np.fromfile(path, dtype=kind, offset=table.header_bytes)
    if not paired:
        return numbers.reshape(table.shape)
    return _complex(path, name, numbers, table.pairs).reshape(table.shape)


def _complex(path: Path, name: str, numbers: np.ndarray, pairs: str) -> np.ndarray:
    together = len(pairs) // 2  # how many of one part follow each other
    if numbers.size % (2 * together):
        raise MeasurementError(
            f'{path}: {name}.raw.pairs = "{pairs}" needs an even number of samples, not '
            f"{numbers.size // 2}; correct pairs or shape"
        )
    parts = numbers.reshape(-1, 2, together).astype(np.float64)
    first, second = parts[:, 0].ravel(), parts[:, 1].ravel()
    return first + 1j * second if pairs.startswith("I") else second + 1j * first
