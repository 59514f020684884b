"""Reading a store that may be damaged or hostile: one message for all that can be wrong with it.

What a store from elsewhere may do is bounded before it is done: no link in it leads out of its
folder, no chunk is larger than the memory of a small machine, none unpacks to more than it may.
"""

import json
import math
import os
import zlib
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from pathlib import Path

from zarr.abc.store import ByteRequest
from zarr.core.buffer import Buffer, BufferPrototype
from zarr.storage import LocalStore, WrapperStore

from estimator.measurement.model import MeasurementError

LARGEST_CHUNK = 2**30
"""Most bytes that a chunk may have, packed or unpacked. [byte]"""

LARGEST_METADATA = 10 * 2**20
"""Largest zarr.json that is read. [byte]"""

MOST_VALUES = 2**28
"""Most values of all arrays of one measurement: 4 GiB as complex numbers."""

_SHOWN = 200  # of what other software says about a damaged store, in characters
_WIDEST = 16  # bytes of a complex number
_GZIP = b"\x1f\x8b"
_PIECE = 2**20  # of what a gzip stream unpacks to, looked at and dropped [byte]
_ZSTANDARD = b"\x28\xb5\x2f\xfd"


def is_store(path: Path) -> bool:
    """Tell whether a Zarr v3 group lies at ``path``."""
    try:
        return (path / "zarr.json").is_file()
    except (OSError, ValueError):  # a name that no file system takes
        return False


@contextmanager
def damage_told(path: Path) -> Iterator[None]:
    """Turn whatever fails in the block into a message that names the store.

    Raises
    ------
    MeasurementError
        If anything fails.
    """
    try:
        yield
    except MeasurementError:
        raise
    except Exception as error:  # Zarr, codecs and JSON fail in many ways on a damaged store
        told = f"{type(error).__name__}: {error}"
        raise MeasurementError(
            f"{path}: the store cannot be read ({shortened(told)}); "
            "it may be truncated: write it again"
        ) from error


def opened_store(path: Path, *, hidden: tuple[str, ...] = ()) -> "GuardedStore":
    """Open a store for reading.

    Parameters
    ----------
    path
        Its folder.
    hidden
        Groups of its root that are not to be seen, not even their names.

    Raises
    ------
    MeasurementError
        If nothing is there, or no Zarr v3 group.
    """
    try:
        there = path.exists()
    except (OSError, ValueError) as error:
        raise MeasurementError(
            f"{shortened(str(path))}: cannot be a file's name ({error})"
        ) from None
    if not there:
        raise MeasurementError(f"{path}: no such file or folder")
    if not is_store(path):
        raise MeasurementError(
            f"{path}: not a Zarr v3 group (no zarr.json in it); "
            "`mmslam import` converts measured data into a measurement store"
        )
    return GuardedStore(LocalStore(path, read_only=True), path=path, hidden=hidden)


def shortened(text: str) -> str:
    """Cut a text that came from elsewhere, for a message."""
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}… ({len(text)} characters)"


class GuardedStore(WrapperStore[LocalStore]):
    """A store whose chunks and metadata are looked at before they are used."""

    def __init__(
        self, store: LocalStore, path: Path | None = None, hidden: tuple[str, ...] = ()
    ) -> None:
        """Guard a store; Zarr itself copies it with the first argument alone."""
        super().__init__(store)
        self._path = store.root if path is None else path
        self._hidden = hidden

    def _with_store(self, store: LocalStore) -> "GuardedStore":
        return GuardedStore(store, path=self._path, hidden=self._hidden)

    async def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """List what lies in a folder, but for what is hidden in the root."""
        async for name in super().list_dir(prefix):
            if prefix.strip("/") or name.strip("/") not in self._hidden:
                yield name

    async def get(
        self,
        key: str,
        prototype: BufferPrototype,
        byte_range: ByteRequest | None = None,
    ) -> Buffer | None:
        """Read a chunk or metadata, if it is what it may be."""
        self._check_file(key)
        found = await super().get(key, prototype, byte_range)
        if found is not None:
            self._check_content(key, found)
        return found

    def _check_file(self, key: str) -> None:
        place = os.path.realpath(self._path / key)
        if not Path(place).is_relative_to(os.path.realpath(self._path)):
            raise MeasurementError(
                f"{self._path}: {key} is a link out of the store; copy the file into it"
            )
        try:
            size = os.stat(place).st_size
        except OSError:
            return  # missing: Zarr fills it in, or says so
        limit = LARGEST_METADATA if key.endswith("zarr.json") else LARGEST_CHUNK
        if size > limit:
            raise MeasurementError(
                f"{self._path}: {key} has {size} bytes, more than {limit}; write it in smaller "
                "chunks"
            )

    def _check_content(self, key: str, found: Buffer) -> None:
        if key.endswith("zarr.json"):
            self._check_chunks(key, found.to_bytes())
            return
        head = found[:18].to_bytes()
        size = _unpacked_size(head)
        told = f"{size} bytes, more than {LARGEST_CHUNK}"
        if head[:2] == _GZIP and _unpacks_to_more(found.to_bytes(), LARGEST_CHUNK):
            size, told = LARGEST_CHUNK + 1, f"more than {LARGEST_CHUNK} bytes"
        if size is not None and size > LARGEST_CHUNK:
            raise MeasurementError(
                f"{self._path}: {key} unpacks to {told}; it may be damaged: write it again"
            )

    def _check_chunks(self, key: str, content: bytes) -> None:
        metadata = json.loads(content)
        if not isinstance(metadata, dict):
            return
        if not isinstance(metadata.get("attributes", {}), dict):
            raise MeasurementError(
                f"{self._path}: the attributes in {key} are no table; it is damaged: write it again"
            )
        if metadata.get("node_type") != "array":
            return
        shape = metadata["chunk_grid"]["configuration"]["chunk_shape"]
        if math.prod(shape) * _WIDEST > LARGEST_CHUNK:
            raise MeasurementError(
                f"{self._path}: {key} has chunks of shape {shortened(str(shape))}, more than "
                f"{LARGEST_CHUNK} bytes; write it in smaller chunks"
            )


def _unpacked_size(head: bytes) -> int | None:
    """Return what a Zstandard frame says that it unpacks to (RFC 8878, 3.1.1.1). [byte]."""
    if head[:4] != _ZSTANDARD or len(head) < 18:
        return None
    descriptor = head[4]
    flag, single = descriptor >> 6, bool(descriptor & 0x20)
    if flag == 0 and not single:
        return None  # it does not say; unpacked piece by piece
    start = 5 + (0 if single else 1) + (0, 1, 2, 4)[descriptor & 3]
    length = (1, 2, 4, 8)[flag]
    size = int.from_bytes(head[start : start + length], "little")
    return size + 256 if flag == 1 else size


def _unpacks_to_more(content: bytes, limit: int) -> bool:
    """Unpack gzip piece by piece, keeping nothing; what is damaged is left to its codec."""
    total = 0
    while content[:2] == _GZIP:  # members follow each other
        member = zlib.decompressobj(wbits=31)
        while not member.eof and content:
            try:
                piece = member.decompress(content, _PIECE)
            except zlib.error:
                return False
            total += len(piece)
            if total > limit:
                return True
            content = member.unconsumed_tail
            if not piece and not content:
                break
        content = member.unused_data
    return False
