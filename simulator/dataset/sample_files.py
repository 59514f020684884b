"""Rows of a dataset in files of their own, written atomically."""

import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from simulator.dataset.sample import Row


def save_row(path: Path, row: Row) -> None:
    """Write arrays to a temporary file, flush it to the disk, and rename it."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    plain: dict[str, Any] = {
        # NumPy files hold no variable-length strings except as pickles, which are never read here.
        key: np.array(values.tolist(), dtype=np.str_) if values.dtype.kind == "T" else values
        for key, values in row.items()
    }
    try:
        with part.open("wb") as file:
            np.savez(file, **plain)
            file.flush()
            os.fsync(file.fileno())
        part.rename(path)
    finally:
        part.unlink(missing_ok=True)


def load_row(path: Path, only: tuple[str, ...] | None = None) -> Row:
    """Read all or some arrays of a file; pickled objects are refused."""
    with np.load(path, allow_pickle=False) as held:
        return {key: held[key] for key in (only or held.files)}


def is_whole(path: Path) -> bool:
    """Return whether a file is complete, by its checksums."""
    try:
        with zipfile.ZipFile(path) as held:
            return held.testzip() is None
    except (OSError, zipfile.BadZipFile):
        return False


def numbers_in(folder: Path) -> Iterator[int]:
    """Yield the numbers that are the names of a folder's files, in any order."""
    with os.scandir(folder) as entries:
        for entry in entries:
            stem, _, suffix = entry.name.partition(".")
            if suffix == "npz" and stem.isdigit():
                yield int(stem)


def flush(path: Path) -> None:
    """Flush a file, or all files below a folder, to the disk (fsync)."""
    for one in [path, *path.rglob("*")] if path.is_dir() else [path]:
        if one.is_file():
            with one.open("rb") as file:
                os.fsync(file.fileno())
