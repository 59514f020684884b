"""Rows of a dataset in files of their own: each there whole, or not at all."""

import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from simulator.dataset.sample import Row


def save_row(path: Path, row: Row) -> None:
    """Write arrays aside, flush them to the disk, and give them their name."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    plain: dict[str, Any] = {
        # NumPy's files know no variable-length strings, and a pickle is read nowhere here.
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
    """Read arrays, all of a file or only some. Nothing pickled is read."""
    with np.load(path, allow_pickle=False) as held:
        return {key: held[key] for key in (only or held.files)}


def is_whole(path: Path) -> bool:
    """Tell whether a file was written to its end, by its checksums."""
    try:
        with zipfile.ZipFile(path) as held:
            return held.testzip() is None
    except (OSError, zipfile.BadZipFile):
        return False


def numbers_in(folder: Path) -> Iterator[int]:
    """Yield the numbers by which a folder's files are called, in any order."""
    with os.scandir(folder) as entries:
        for entry in entries:
            stem, _, suffix = entry.name.partition(".")
            if suffix == "npz" and stem.isdigit():
                yield int(stem)


def flush(path: Path) -> None:
    """Have a file, or all below a folder, on the disk before anything says that it is."""
    for one in [path, *path.rglob("*")] if path.is_dir() else [path]:
        if one.is_file():
            with one.open("rb") as file:
                os.fsync(file.fileno())
