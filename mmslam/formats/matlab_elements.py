"""The elements of a MATLAB 5 file, checked before SciPy reads them.

SciPy looks an element's data type up in a table without asking whether it is in there; a damaged
number ends the process. Sizes that the elements promise are checked as well. Only tags are kept:
data are passed over, packed ones a piece at a time.

Source: "MAT-File Format", The MathWorks, chapter 1 (level 5).
"""

import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from estimator.measurement.model import MeasurementError

HEADER = 128
"""Bytes before the first element."""
NUMERIC = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18})
"""Data types of numbers and characters (miINT8 … miUINT64, miUTF8 … miUTF32)."""
MATRIX, COMPRESSED = 14, 15
"""Data types that hold other elements (miMATRIX, miCOMPRESSED)."""
DEEPEST = 64
"""Structures within structures, beyond which a file is taken to be damaged."""
ALIGNED = 8
"""Elements begin at multiples of so many bytes, and so many has a tag."""
PIECE = 2**20
"""Bytes that are held at once."""


def check_elements(path: Path) -> None:
    """Refuse a file of MATLAB 5 whose elements are not what they say; others are left alone.

    Raises
    ------
    MeasurementError
        If an element has no known data type, or is longer than what holds it.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        mark = file.read(HEADER)[126:]
        if mark not in (b"IM", b"MI"):
            return  # version 4, or none: SciPy says so
        order = "<" if mark == b"IM" else ">"
        try:
            _check(_Plain(file), size - HEADER, order, 0)
        except (ValueError, zlib.error) as error:
            raise MeasurementError(
                f"{path}: is damaged: {error}; save it again, from MATLAB as version 7"
            ) from error


class _Plain:
    """Bytes of a file as they are."""

    def __init__(self, file: BinaryIO) -> None:
        """Go on where the file stands."""
        self.file = file

    def take(self, count: int) -> bytes:
        """Return the next bytes."""
        found = self.file.read(count)
        if len(found) < count:
            raise ValueError("it ends within an element")
        return found

    def drop(self, count: int) -> None:
        """Pass over the next bytes."""
        self.file.seek(count, 1)


class _Unpacked:
    """Bytes that a part of a stream unpacks to."""

    def __init__(self, packed: "_Plain | _Unpacked", size: int) -> None:
        """Unpack the next ``size`` bytes."""
        self.packed, self.left = packed, size
        self.unpacking = zlib.decompressobj()
        self.held = b""

    def take(self, count: int) -> bytes:
        """Return the next bytes."""
        while len(self.held) < count:
            more = self.unpacking.unconsumed_tail
            if not more and self.left:
                more = self.packed.take(min(PIECE, self.left))
                self.left -= len(more)
            unpacked = self.unpacking.decompress(more, PIECE)
            if not unpacked and not more:
                raise ValueError("it ends within an element")
            self.held += unpacked
        found, self.held = self.held[:count], self.held[count:]
        return found

    def drop(self, count: int) -> None:
        """Pass over the next bytes."""
        while count > 0:
            count -= len(self.take(min(PIECE, count)))


def _check(stream: _Plain | _Unpacked, size: int, order: str, depth: int) -> None:
    """Check the elements that the next bytes of a stream hold; it stands behind them then."""
    if depth > DEEPEST:
        raise ValueError(f"more than {DEEPEST} structures in each other")
    while size >= ALIGNED:
        size -= ALIGNED + _check_element(stream, size - ALIGNED, order, depth)
    stream.drop(size)


def _check_element(stream: _Plain | _Unpacked, most: int, order: str, depth: int) -> int:
    """Check one element of at most ``most`` bytes behind its tag; return how many it has."""
    kind: int
    size: int
    kind, size = struct.unpack(f"{order}II", stream.take(ALIGNED))
    if kind >> 16:  # four bytes or fewer, within the tag
        kind, size = kind & 0xFFFF, kind >> 16
        if size > 4:
            raise ValueError(f"an element of {size} bytes is said to fit into 4")
        if kind not in NUMERIC:
            raise ValueError(f"an element has the unknown data type {kind}")
        return 0
    if size > most:
        raise ValueError(f"an element of {size} bytes is longer than what holds it")
    if kind == COMPRESSED:
        unpacked = _Unpacked(stream, size)
        _check_element(unpacked, 2**32, order, depth + 1)
        stream.drop(unpacked.left)
        return size
    padded = min(size + -size % ALIGNED, most)
    if kind == MATRIX:
        _check(stream, size, order, depth + 1)
    elif kind in NUMERIC:
        stream.drop(size)
    else:
        raise ValueError(f"an element has the unknown data type {kind}")
    stream.drop(padded - size)
    return padded
