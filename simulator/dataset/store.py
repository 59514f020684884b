"""An unfinished dataset on disk: every file is complete or absent, and work can resume.

The folder ``FILE.zarr.unfinished`` is beside ``FILE.zarr`` until all samples are done::

    dataset.json        what is being made; another configuration or version is refused
    samples/N.npz       one file for each sample that is done
    store/              the Zarr store; a block of samples is one file of it
    blocks/B.npz        the labels of a block whose echo and uplinks are in the store
    lock                held by the process that hands out the work

Every file is written under another name, flushed to the disk and renamed. A sample is done when
``samples/N.npz`` or its block is there; ``store`` becomes ``FILE.zarr`` in one step at the end.
"""

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import zarr

from estimator.measurement.atomic_rename import rename_new
from estimator.measurement.file_lock import file_lock
from simulator.dataset.config import differences
from simulator.dataset.layout import LABEL_SAMPLES, Layout
from simulator.dataset.sample import Row
from simulator.dataset.sample_files import flush, is_whole, load_row, numbers_in, save_row
from simulator.dataset.variables import FAILED, TEXT, Variable
from simulator.dataset.zarr_arrays import create_store, failed_samples, stored_array

JOB = "dataset.json"
IDENTITY = ("config", "base", "versions", "code")


OURS = frozenset({JOB, f"{JOB}.part", "store", "store.part", "samples", "blocks", "lock"})
"""All names that may be in the folder, whenever the process was killed."""


class DatasetError(ValueError):
    """A dataset cannot be written or resumed; the message says why and what to do."""


class GrowingDataset:
    """The folder of a dataset that is being made."""

    def __init__(self, target: Path, layout: Layout) -> None:
        self.target = target
        self.layout = layout
        self.folder = target.with_name(target.name + ".unfinished")
        self.store = self.folder / "store"

    # Start and end

    def begin(self) -> None:
        """Create the folder, or resume in it: partial files are removed, complete ones kept.

        Raises
        ------
        DatasetError
            If the folder holds something else, or a dataset of another configuration or version.
        """
        if (self.folder / JOB).is_file() and self.store.exists():
            self._refuse_another(json.loads((self.folder / JOB).read_text(encoding="utf-8")))
            self._clear_torn()
            return
        self._start_anew()
        making = self.folder / "store.part"
        create_store(making, self.layout)
        self._write_job()
        making.rename(self.store)  # last: before this, a new process starts anew

    def reopen(self) -> tuple[int, ...]:
        """Turn the finished dataset into an unfinished one without its failed samples.

        Returns
        -------
        The samples to be made again; if none, nothing was changed.
        """
        failed = tuple(failed_samples(self.target))
        if not failed:
            return ()
        self._start_anew()
        again = {sample // self.layout.block for sample in failed}
        for block in range(self.layout.blocks):
            samples = self.layout.block_samples(block)
            if block not in again:
                self._write_block(block, _read_labels(self.target, self.layout, samples))
                continue
            for sample in samples:
                if sample not in failed:
                    self.put(sample, _read_row(self.target, self.layout, sample))
        self._write_job()
        self.target.rename(self.store)
        return failed

    def discard(self) -> None:
        """Remove the folder except the lock, when the dataset itself is complete."""
        for name in OURS - {"lock"}:
            _remove(self.folder / name)

    def forget_failed(self) -> None:
        """Delete the failed samples of the unfinished dataset, so that they are made again."""
        for sample in self.staged():
            if int(self._staged_row(sample)["status"]) == FAILED:
                self._sample_file(sample).unlink()
        for block in self.collected():
            labels = load_row(self._block_file(block))
            if not np.any(labels["status"] == FAILED):
                continue
            for at, sample in enumerate(self.layout.block_samples(block)):
                if int(labels["status"][at]) != FAILED:
                    row = {key: _only(values[at : at + 1]) for key, values in labels.items()}
                    self.put(sample, row | _read_large(self.store, self.layout, sample))
            self._block_file(block).unlink()

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the folder against other processes; the lock is released when the process ends.

        Raises
        ------
        DatasetError
            If another process holds it.
        """
        with file_lock(self.folder / "lock") as held:
            if not held:
                raise DatasetError(
                    f"{self.target} is being made by another process; wait for it, or choose "
                    "another file"
                )
            try:
                yield
            finally:
                if {one.name for one in self.folder.iterdir()} <= {"lock"}:
                    # All is done, or nothing was begun. The lock goes last: a process that
                    # comes now must find an empty folder.
                    (self.folder / "lock").unlink(missing_ok=True)
                    with suppress(OSError):
                        self.folder.rmdir()

    # Progress

    def staged(self) -> list[int]:
        """Return the samples that are done, but not in the store yet."""
        return sorted(numbers_in(self.folder / "samples"))

    def collected(self) -> list[int]:
        """Return the blocks that are in the store."""
        return sorted(numbers_in(self.folder / "blocks"))

    def done(self) -> np.ndarray:
        """Return for every sample whether it is done. [bool]."""
        done = np.zeros(self.layout.samples, dtype=bool)
        done[self.staged()] = True
        for block in self.collected():
            samples = self.layout.block_samples(block)
            done[samples.start : samples.stop] = True
        return done

    def failed(self) -> list[int]:
        """Return the samples that are done and have failed."""
        found = [n for n in self.staged() if int(self._staged_row(n)["status"]) == FAILED]
        for block in self.collected():
            status = load_row(self._block_file(block), only=("status",))["status"]
            start = self.layout.block_samples(block).start
            found += [start + int(at) for at in np.flatnonzero(status == FAILED)]
        return sorted(found)

    # For workers

    def put(self, sample: int, row: Row) -> None:
        """Write a sample's row to its file."""
        save_row(self._sample_file(sample), row)

    def collect(self, block: int) -> None:
        """Move all samples of a block from their files into the store.

        If a worker is killed meanwhile, the next call resumes where it was.
        """
        samples = self.layout.block_samples(block)
        if self._block_file(block).exists():  # written last: the store holds the block
            self._unstage(samples)
            return
        rows = [self._staged_row(sample) for sample in samples]
        group = zarr.open_group(self.store, mode="r+")
        for variable in self.layout.variables:
            if variable.large:
                array = stored_array(group, variable.key)
                array[samples.start : samples.stop] = np.stack(
                    [row.pop(variable.key) for row in rows]
                )
                flush(self.store / variable.key / "c" / str(block))
        self._write_block(block, {key: np.stack([row[key] for row in rows]) for key in rows[0]})
        self._unstage(samples)

    def finish(self) -> None:
        """Write the labels into the store, and rename it to its final name."""
        group = zarr.open_group(self.store, mode="r+")
        per_chunk = LABEL_SAMPLES // self.layout.block
        small = [one for one in self.layout.variables if not one.large]
        for first in range(0, self.layout.blocks, per_chunk):
            blocks = range(first, min(first + per_chunk, self.layout.blocks))
            parts = [load_row(self._block_file(block)) for block in blocks]
            start = blocks.start * self.layout.block
            for variable in small:
                values = np.concatenate([part[variable.key] for part in parts])
                array = stored_array(group, variable.key)
                array[start : start + len(values)] = _as_stored(variable, values)
        for variable in small:
            flush(self.store / variable.key)
        self._clear_partial()  # of workers that were killed
        rename_new(self.store, self.target)
        self.discard()

    # Files of the folder

    def _sample_file(self, sample: int) -> Path:
        return self.folder / "samples" / f"{sample}.npz"

    def _block_file(self, block: int) -> Path:
        return self.folder / "blocks" / f"{block}.npz"

    def _unstage(self, samples: range) -> None:
        for sample in samples:
            self._sample_file(sample).unlink(missing_ok=True)

    def _staged_row(self, sample: int) -> Row:
        return load_row(self._sample_file(sample))

    def _write_block(self, block: int, labels: Row) -> None:
        save_row(self._block_file(block), labels)

    def _write_job(self) -> None:
        text = json.dumps({key: self.layout.attributes[key] for key in IDENTITY})
        part = self.folder / f"{JOB}.part"
        part.write_text(text, encoding="utf-8")
        flush(part)
        part.rename(self.folder / JOB)

    def _refuse_another(self, job: Mapping[str, str]) -> None:
        mine = {key: self.layout.attributes[key] for key in IDENTITY}
        if found := differences(mine, job):
            raise DatasetError(
                f"{self.folder} was begun with another {', another '.join(found)}; finish it with "
                "that, or remove the folder, or choose another file"
            )

    def _start_anew(self) -> None:
        """Remove files from before the store was made, and those that the finished one replaces."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if foreign := sorted({one.name for one in self.folder.iterdir()} - OURS):
            raise DatasetError(
                f"{self.folder} holds what mmslam did not write ({foreign[0]}); move it away or "
                "choose another file"
            )
        self.discard()
        for name in ("samples", "blocks"):
            (self.folder / name).mkdir()

    def _clear_torn(self) -> None:
        """Remove partial files of a process that was killed."""
        for folder in (self.folder, self.folder / "samples", self.folder / "blocks"):
            folder.mkdir(exist_ok=True)
            for entry in folder.iterdir():
                if ".part" in entry.suffixes or entry.name.endswith(".part"):
                    _remove(entry)
        self._clear_partial()

    def _clear_partial(self) -> None:
        for partial in self.store.rglob("*.partial"):
            partial.unlink()
        collected = set(self.collected())
        for sample in self.staged():
            path = self._sample_file(sample)
            if sample // self.layout.block in collected or not is_whole(path):
                path.unlink()
        for block in collected:
            if not is_whole(self._block_file(block)):
                self._block_file(block).unlink()


def _as_stored(variable: Variable, values: np.ndarray) -> np.ndarray:
    return values.astype(np.dtypes.StringDType()) if variable.type == TEXT else values


def _read_labels(store: Path, layout: Layout, samples: range) -> Row:
    group = zarr.open_group(store, mode="r")
    found = {}
    for variable in layout.variables:
        if not variable.large:
            array = stored_array(group, variable.key)
            found[variable.key] = np.asarray(array[samples.start : samples.stop])
    return found


def _read_large(store: Path, layout: Layout, sample: int) -> Row:
    group = zarr.open_group(store, mode="r")
    found = {}
    for variable in layout.variables:
        if variable.large:
            array = stored_array(group, variable.key)
            found[variable.key] = np.asarray(array[sample])
    return found


def _read_row(store: Path, layout: Layout, sample: int) -> Row:
    labels = _read_labels(store, layout, range(sample, sample + 1))
    alone = {key: _only(values) for key, values in labels.items()}
    return alone | _read_large(store, layout, sample)


def _only(values: np.ndarray) -> np.ndarray:
    """Remove the leading dimension; for texts, an index would return `str`, not an array."""
    return values.reshape(values.shape[1:])


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
