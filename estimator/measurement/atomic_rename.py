"""Renames that lose nothing: two names exchanged in one step, or one given only if it is free.

A plain rename puts an empty folder, or any file, out of the way without a word; and a folder that
is not empty cannot be replaced by one rename. Linux has ``renameat2`` for both; where the kernel,
the C library or the file system lacks it, callers are told, and go another way.
"""

import ctypes
import errno
import functools
import os
from collections.abc import Callable
from pathlib import Path

_AT_FDCWD = -100
_NOREPLACE, _EXCHANGE = 1, 2  # linux/fs.h

# Said by a kernel (ENOSYS), a file system (EINVAL, ENOTSUP), an overlay (EXDEV), a sandbox (EPERM).
_LACKING = frozenset({errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EXDEV, errno.EPERM})


def exchange(one: Path, other: Path) -> bool:
    """Exchange what two names of one file system stand for, in one step.

    Returns
    -------
    Whether it was done; False: this system cannot, and nothing was changed.

    Raises
    ------
    OSError
        If one of them is missing, or may not be renamed.
    """
    return _renameat2(one, other, _EXCHANGE)


def rename_new(source: Path, target: Path) -> None:
    """Rename a file or folder to a name that nothing has.

    Raises
    ------
    FileExistsError
        If something has it. (Where the system lacks ``renameat2``, an empty folder that somebody
        made in that very moment is replaced; it holds nothing.)
    OSError
        If it cannot be renamed.
    """
    if _renameat2(source, target, _NOREPLACE):
        return
    if os.path.lexists(target):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
    if source.is_dir():
        try:
            source.rename(target)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.ENOTDIR):
                raise
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from None
        return
    try:
        os.link(source, target)  # refuses a name that is taken, as a rename does not
    except FileExistsError:
        raise
    except OSError:  # no hard links here
        source.rename(target)
    else:
        source.unlink()


def _renameat2(one: Path, other: Path, flags: int) -> bool:
    call = _system_call()
    if call is None:
        return False
    if call(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), flags) == 0:
        return True
    number = ctypes.get_errno()
    if number in _LACKING:
        return False
    raise OSError(number, os.strerror(number), str(one), None, str(other))


@functools.cache
def _system_call() -> Callable[[int, bytes, int, bytes, int], int] | None:
    try:
        call = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):  # another system, or an older C library
        return None
    call.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint]
    call.restype = ctypes.c_int
    found: Callable[[int, bytes, int, bytes, int], int] = call
    return found
