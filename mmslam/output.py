"""Where results go: written aside and renamed at the end, so nothing is ever half-written."""

import errno
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

RESULT = "result.json"
MEASUREMENT = "measurement.zarr"
REPORT = "report.html"
TRACK = "track.json"
TRACK_FIGURE = "track.png"
FORMAT = 1

FIGURES = ("raw_image.png", "corrected_image.png", "angle_range_map.png", "localization.png")

_SETTLING = 0.05  # how long late writers are given after each removal [s]
_ABSENCES = 4  # how often the folder must then be found absent
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
}


class OutputError(ValueError):
    """A result cannot go where it was asked to; the message says why and what to do."""


@contextmanager
def replacing(target: Path, refusal: Callable[[Path], str | None]) -> Iterator[Path]:
    """Give a path whose folder takes the place of ``target`` once the block has ended well.

    If the block fails or is interrupted, ``target`` and its parents are as they were.

    Parameters
    ----------
    target
        Where the folder shall be in the end; links are followed.
    refusal
        Says why something that is already there must not be replaced (None: it may be).

    Yields
    ------
    The folder to make and fill; it does not exist yet and lies on the same file system.

    Raises
    ------
    OutputError
        Before the block: if ``target`` must not be replaced or cannot be written beside;
        after it: if the disk was full.
    """
    target = target.resolve()
    missing: list[Path] = []
    aside: Path | None = None
    try:
        _check_replaceable(target, refusal)
        missing = [parent for parent in target.parents if not parent.exists()]
        target.parent.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(prefix=f".{target.name[:60]}-", dir=target.parent))
        new = aside / "new"  # mkdtemp's own folder is closed to others, this one need not be
        yield new
        _exchange(new, target, aside / "old")
        shutil.rmtree(aside, ignore_errors=True)
    except OSError as error:
        reason = _PLACE_ERRORS.get(error.errno or 0)
        if reason is None:
            raise
        raise OutputError(
            f"cannot write {target}: {reason} ({error.strerror}); free it or choose another "
            "place (nothing was left behind)"
        ) from error
    finally:
        if aside is not None and aside.exists():
            _remove(aside)
        for parent in missing:  # innermost first; stops at the first that is not empty
            with suppress(OSError):
                parent.rmdir()


def refuse_to_replace_input(folder: Path, path: Path) -> None:
    """Refuse a folder for results that what they are made of lies in.

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


def refuse_foreign_results(folder: Path) -> str | None:
    """Say why a folder may not be replaced by new results; None if an earlier run made it."""
    return _refuse_foreign(
        folder, RESULT, {"users", "mirrors", "versions"}, {MEASUREMENT, REPORT, *FIGURES}
    )


def refuse_foreign_track(folder: Path) -> str | None:
    """Say why a folder may not be replaced by a new track; None if an earlier one is in it."""
    return _refuse_foreign(folder, TRACK, {"tracks", "versions"}, {TRACK_FIGURE})


def _refuse_foreign(folder: Path, main: str, keys: set[str], beside: set[str]) -> str | None:
    names = {entry.name for entry in folder.iterdir()}
    if not names:
        return None
    document = _json(folder / main)
    if document.get("format") != FORMAT or not keys <= document.keys():
        return f"it is not empty and no earlier run of mmslam made it (no {main} of ours in it)"
    foreign = sorted(name for name in names - {main, *beside} if not name.startswith("."))
    if foreign:
        return f"it holds what mmslam did not write ({', '.join(foreign[:3])})"
    return None


def refuse_foreign_store(folder: Path) -> str | None:
    """Say why a folder may not be replaced by a new measurement; None if it is one of ours."""
    if not any(folder.iterdir()):
        return None
    root = _json(folder / "zarr.json")
    if "mmslam_format" not in (root.get("attributes") or {}):
        return "it is not a measurement that mmslam wrote"
    return None


def _remove(folder: Path) -> None:
    """Remove a folder that threads may still write to: Zarr's go on after a failure."""
    absent = 0
    for _ in range(_MOST_REMOVALS):
        if folder.exists():
            shutil.rmtree(folder, ignore_errors=True)
            absent = 0
        elif (absent := absent + 1) == _ABSENCES:
            return
        time.sleep(_SETTLING)


def _check_replaceable(target: Path, refusal: Callable[[Path], str | None]) -> None:
    reason = None
    if target.exists():
        if not target.is_dir():
            reason = "it is a file"
        elif os.path.ismount(target) or Path.cwd().is_relative_to(target):
            reason = "it is the current folder or a mount point, which cannot be exchanged"
        else:
            reason = refusal(target)
    if reason:
        raise OutputError(
            f"{target} exists and will not be replaced: {reason}; "
            "move it away or choose another place"
        )


def _exchange(new: Path, target: Path, old: Path) -> None:
    # A folder that is not empty cannot be replaced in one step: move the old one out first,
    # and back if anything, an interruption included, comes between.
    replaced = target.exists()
    try:
        if replaced:
            target.rename(old)
        new.rename(target)
    except BaseException:
        if replaced and old.exists() and not target.exists():
            old.rename(target)
        raise


def _json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, dict) else {}
