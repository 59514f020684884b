"""The elements of a MATLAB 5 file, checked before SciPy reads them.

SciPy looks an element's data type up in a table without asking whether it is in there; a damaged
number ends the process. Sizes that the elements promise are checked as well.

Source: "MAT-File Format", The MathWorks, chapter 1 (level 5).
"""

import struct
import zlib
from pathlib import Path

from estimator.measurement.model import MeasurementError

HEADER = 128
"""Bytes before the first element."""
NUMERIC = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18})
"""Data types of numbers and characters (miINT8 … miUINT64, miUTF8 … miUTF32)."""
MATRIX, COMPRESSED = 14, 15
"""Data types that hold other elements (miMATRIX, miCOMPRESSED)."""
DEEPEST = 64
"""Structures within structures, beyond which a file is taken to be damaged."""
LARGEST = 1 << 30
"""Bytes to which one element may be unpacked only to be checked: SciPy's own limit is 2 GiB."""
ALIGNED = 8
"""Elements begin at multiples of so many bytes."""


def check_elements(path: Path) -> None:
    """Refuse a file of MATLAB 5 whose elements are not what they say; others are left alone.

    Raises
    ------
    MeasurementError
        If an element has no known data type, or is longer than what holds it.
    """
    with path.open("rb") as file:
        content = file.read()
    mark = content[126:HEADER]
    if len(content) < HEADER or mark not in (b"IM", b"MI"):
        return  # version 4, or none: SciPy says so
    order = "<" if mark == b"IM" else ">"
    try:
        _check(memoryview(content)[HEADER:], order, 0)
    except (ValueError, struct.error, zlib.error) as error:
        raise MeasurementError(
            f"{path}: is damaged: {error}; save it again, from MATLAB as version 7"
        ) from error


def _check(content: memoryview, order: str, depth: int) -> None:
    if depth > DEEPEST:
        raise ValueError(f"more than {DEEPEST} structures in each other")
    at = 0
    while at + ALIGNED <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        begin = at + ALIGNED
        if kind >> 16:  # four bytes or fewer, within the tag
            kind, size, begin = kind & 0xFFFF, kind >> 16, at + 4
            if size > 4:
                raise ValueError(f"an element of {size} bytes is said to fit into 4")
            after = at + ALIGNED
        else:
            after = begin + size
            if kind != COMPRESSED:
                after += -size % ALIGNED
        if begin + size > len(content):
            raise ValueError(f"an element of {size} bytes is longer than what holds it")
        part = content[begin : begin + size]
        if kind == COMPRESSED:
            _check(_unpacked(part), order, depth + 1)
        elif kind == MATRIX:
            _check(part, order, depth + 1)
        elif kind not in NUMERIC:
            raise ValueError(f"an element has the unknown data type {kind}")
        at = after


def _unpacked(part: memoryview) -> memoryview:
    unpacking = zlib.decompressobj()
    content = unpacking.decompress(part, LARGEST)
    if unpacking.unconsumed_tail:
        raise ValueError(f"an element is more than {LARGEST} bytes long when unpacked")
    return memoryview(content)
