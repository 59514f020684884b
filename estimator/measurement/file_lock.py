"""A lock that one process holds, and that ends with it, however that ends."""

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_LOCKLESS = frozenset({errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS})  # some network file systems


@contextmanager
def file_lock(path: Path, *, mode: int = 0o777) -> Iterator[bool]:
    """Hold the lock of a file while the block runs; never wait for it.

    Parameters
    ----------
    path
        The file; it and its folder are made if they are missing. Whoever holds the lock may
        remove both.
    mode
        Permissions of a folder that is made, before the umask.

    Yields
    ------
    Whether the lock is held; False: another process has it. Where the file system knows no
    locks, nobody is kept out.

    Raises
    ------
    OSError
        If the file cannot be made.
    """
    descriptor = _taken(path, mode)
    try:
        yield descriptor is not None
    finally:
        if descriptor is not None:
            os.close(descriptor)


def _taken(path: Path, mode: int) -> int | None:
    while True:
        path.parent.mkdir(mode=mode, parents=True, exist_ok=True)
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        except FileNotFoundError:  # the folder was removed in this moment
            continue
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            return None
        except OSError as error:
            if error.errno not in _LOCKLESS:
                os.close(descriptor)
                raise
        # The holder before may have removed the file after it was opened here.
        if _is_same(path, descriptor):
            return descriptor
        os.close(descriptor)


def _is_same(path: Path, descriptor: int) -> bool:
    try:
        named = path.stat()
    except FileNotFoundError:
        return False
    held = os.fstat(descriptor)
    return (named.st_dev, named.st_ino) == (held.st_dev, held.st_ino)
