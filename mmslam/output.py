"""Atomic output: results are written to a temporary folder, which replaces the old one at the end.

Beside ``NAME`` lies ``.NAME.mmslam`` while a command works::

    lock            held by the command, so that no other one works on the same output
    new             what is being written
    whole-INODE     what is written, about to take its place; after the exchange, what it replaced
    replaced        the same, where two names cannot be exchanged in one step

A killed command leaves that folder behind; the next one on the same output then restores the
earlier result, at whatever step it was killed.
"""

import errno
import hashlib
import os
import shutil
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from estimator.measurement.atomic_rename import exchange, rename_new
from estimator.measurement.file_lock import file_lock

LONGEST_NAME = 255
"""Longest file name of common file systems. [byte]"""

Refusal = Callable[[Path], str | None]
"""Says why a folder that is already there must not be replaced; None: it may be."""

_SETTLING = 0.05  # waiting time after each removal for threads that still write [s]
_ABSENCES = 4  # successive checks that must find the folder absent
_MOST_REMOVALS = 40

# What a full disk, a quota, a size limit, a read-only place or a missing right report.
_PLACE_ERRORS = {
    errno.ENOSPC: "there is no space left",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "a file would exceed the size limit",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "permission is denied",
    errno.EPERM: "permission is denied",
    errno.ENOTDIR: "a part of the path is no folder",
    errno.EEXIST: "a part of the path is no folder",
    errno.ENAMETOOLONG: "the name is too long",
    errno.EBUSY: "it is in use",
    errno.ENOTEMPTY: "another program is writing there",
    errno.ELOOP: "it is a link that leads nowhere, or in a circle",
}


class OutputError(ValueError):
    """A result cannot be written to the place asked for; the message says why and what to do."""


@contextmanager
def replacing(target: Path, refusal: Refusal) -> Iterator[Path]:
    """Yield the path of a new folder that replaces ``target`` if the block ends without an error.

    If the block fails, is interrupted or killed, ``target`` stays unchanged. At the end ``refusal``
    is asked again before ``target`` is replaced.

    Parameters
    ----------
    target
        Where the folder shall be in the end; links are followed.
    refusal
        Says why something that is already there must not be replaced.

    Yields
    ------
    The folder to make and fill; it does not exist yet and lies on the same file system.

    Raises
    ------
    OutputError
        Before the block: if ``target`` must not be replaced or cannot be written beside, or
        another command works on it. After it: if the disk was full, or if somebody has put
        something else there in the meantime; then the new folder is kept beside it.
    """
    target = _resolved(target)
    with reserved(target, refusal) as aside:
        _check_replaceable(target, refusal)
        yield aside / "new"  # `aside` is closed to others, this one need not be
        _put_in_place(aside, target, refusal)


def refuse_existing(target: Path) -> str:
    """Refuse to replace a folder, whatever it is: for :func:`replacing`."""
    return f"{target} exists; move it away or choose another folder"


@contextmanager
def new_file(target: Path) -> Iterator[Path]:
    """Yield the path of a new file that becomes ``target`` if the block ends without an error.

    Raises
    ------
    OutputError
        As of :func:`replacing`; a file that is already there is never replaced.
    """
    target = _resolved(target)

    def refusal(found: Path) -> str:
        return "it is not empty"

    with reserved(target, refusal) as aside:
        if os.path.lexists(target):
            raise OutputError(f"{target} exists; move it away or choose another name")
        yield aside / "new"
        _put_in_place(aside, target, refusal)


@contextmanager
def reserved(target: Path, refusal: Refusal = lambda found: None) -> Iterator[Path]:
    """Lock an output against other commands while the block runs.

    If an earlier command was killed, the result that it had moved away is restored first.

    Parameters
    ----------
    target
        The output.
    refusal
        Says why a folder left by a killed command must not be removed.

    Yields
    ------
    A folder beside it, private to this user, that is removed at the end.

    Raises
    ------
    OutputError
        If another command works on it, or it cannot be written beside.
    """
    target = _resolved(target)
    aside = _beside(target)
    missing: list[Path] = []
    with _place_errors_told(target):
        with suppress(FileNotFoundError):
            target.lstat()  # a name that is too long is told before any work
        missing = [parent for parent in target.parents if not parent.exists()]
        try:
            _refuse_strangers(aside)
            target.parent.mkdir(parents=True, exist_ok=True)
            with file_lock(aside / "lock", mode=0o700) as held:
                if not held:
                    raise OutputError(
                        f"{target} is being written by another mmslam command; wait until that "
                        "has ended, or choose another place"
                    )
                try:
                    _recover(aside, target, refusal)
                    yield aside
                except BaseException:
                    _recover(aside, target, refusal)
                    _empty(aside, settled=False)
                    raise
                else:
                    _empty(aside, settled=True)
                finally:  # the lock last, so that no other command sees our files
                    (aside / "lock").unlink(missing_ok=True)
                    with suppress(OSError):
                        aside.rmdir()
        finally:
            for parent in missing:  # innermost first; stops at the first that is not empty
                with suppress(OSError):
                    parent.rmdir()


def refuse_to_replace_input(folder: Path, path: Path) -> None:
    """Refuse to replace a folder that contains the measurement being read.

    Raises
    ------
    OutputError
        If it does.
    """
    if path.resolve().is_relative_to(folder.resolve()):
        raise OutputError(
            f"{folder} holds the measurement {path} itself, which would be replaced; "
            "choose another folder with --out"
        )


@contextmanager
def _place_errors_told(target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = _PLACE_ERRORS.get(error.errno or 0)
        if reason is None:
            raise
        raise OutputError(
            f"cannot write {target}: {reason} ({error.strerror}); free it or choose another "
            "place (nothing was left behind)"
        ) from error


def _resolved(target: Path) -> Path:
    try:
        return target.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # links in a circle, a null character
        raise OutputError(f"{target}: {error}; choose another place") from None


def _beside(target: Path) -> Path:
    name = f".{target.name}.mmslam"
    if len(os.fsencode(name)) > LONGEST_NAME:
        digest = hashlib.sha256(os.fsencode(target.name)).hexdigest()[:16]
        name = f".{target.name[:40]}-{digest}.mmslam"
    return target.parent / name


def _refuse_strangers(aside: Path) -> None:
    """Refuse a temporary folder made by another user, or a link: its content would be removed.

    Its name is predictable, and other users may be able to write to the parent folder.
    """
    try:
        found = aside.lstat()
    except FileNotFoundError:
        return
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
        raise OutputError(
            f"{aside} is needed for what is being written, and is a link, a file or another "
            "user's folder; remove it or choose another place"
        )


def _put_in_place(aside: Path, target: Path, refusal: Refusal) -> None:
    """Move the new result to ``target``, if what is there now may be replaced."""
    new = aside / "new"
    whole = aside / f"whole-{new.stat().st_ino}"
    new.rename(whole)
    with suppress(FileExistsError):
        rename_new(whole, target)
        return
    reason = _why_kept(target, refusal)
    if reason is None and exchange(whole, target):
        reason = _why_kept(whole, refusal)  # checked after the move: now stable
        if reason is None:
            _discard(whole)
            return
        exchange(whole, target)
    elif reason is None:
        reason = _exchange_by_renames(aside, whole, target, refusal)
    if reason is None:
        return
    kept = _kept_beside(whole, target)
    raise OutputError(
        f"{target} was changed while the command worked, and is left as it is: {reason}; what "
        f"was to go there is {kept}"
    )


def _exchange_by_renames(aside: Path, whole: Path, target: Path, refusal: Refusal) -> str | None:
    """Exchange by two renames, and back if what was there must not be replaced; return why."""
    replaced = aside / "replaced"
    target.rename(replaced)
    reason = _why_kept(replaced, refusal)
    if reason is None:
        try:
            rename_new(whole, target)
        except FileExistsError:
            kept = _kept_beside(replaced, target)
            return f"somebody has put something else there (the earlier result is {kept})"
        _discard(replaced)
        return None
    rename_new(replaced, target)
    return reason


def _kept_beside(whole: Path, target: Path) -> Path:
    for number in range(1, 1000):
        kept = target.with_name(f"{target.stem[:40]}-new{number}{target.suffix[:10]}")
        with suppress(FileExistsError):
            rename_new(whole, kept)
            return kept
    raise OutputError(f"{target}: too many of its neighbours are called -new…; remove some")


def _recover(aside: Path, target: Path, refusal: Refusal) -> None:
    """Restore the earlier result after a command was killed, and remove that command's files.

    Raises
    ------
    OutputError
        If something lies there that can neither be put back nor is ours to remove.
    """
    replaced = aside / "replaced"
    in_place = True
    for whole in aside.glob("whole-*"):
        inode = int(whole.name.partition("-")[2])
        if whole.lstat().st_ino == inode:  # never came into its place
            in_place = False
            if replaced.exists() and not target.exists():
                rename_new(replaced, target)
        elif _why_kept(whole, refusal) is not None:
            # It was exchanged against what must not be replaced. Back, if nobody has touched
            # the new one since.
            if not os.path.lexists(target):
                rename_new(whole, target)
            elif (
                target.lstat().st_ino != inode
                or _why_kept(target, refusal) is not None
                or not exchange(whole, target)
            ):
                raise _left_over(whole, target)
        _discard(whole)
    if os.path.lexists(replaced):
        if not os.path.lexists(target):
            rename_new(replaced, target)
        elif not in_place or _why_kept(replaced, refusal) is not None:
            raise _left_over(replaced, target)
        _discard(replaced)
    _discard(aside / "new")


def _left_over(found: Path, target: Path) -> OutputError:
    kept = _kept_beside(found, target)
    return OutputError(
        f"{target} was changed while a command that was killed worked on it; what had been there "
        f"is {kept} now: compare them, and remove what you do not need"
    )


def _discard(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _empty(folder: Path, *, settled: bool) -> None:
    """Remove all but the lock; threads may still write unless all is settled: Zarr's go on."""
    absent = 0
    for _ in range(_MOST_REMOVALS):
        left = [entry for entry in folder.iterdir() if entry.name != "lock"]
        for entry in left:
            _discard(entry)
        absent = 0 if left else absent + 1
        if settled or absent == _ABSENCES:
            return
        time.sleep(_SETTLING)


def _check_replaceable(target: Path, refusal: Refusal) -> None:
    if os.path.lexists(target) and (reason := _why_kept(target, refusal)):
        raise OutputError(
            f"{target} exists and will not be replaced: {reason}; "
            "move it away or choose another place"
        )


def _why_kept(target: Path, refusal: Refusal) -> str | None:
    if not target.is_dir():
        return "it is a file"
    if os.path.ismount(target) or Path.cwd().is_relative_to(target):
        return "it is the current folder or a mount point, which cannot be exchanged"
    return refusal(target)
