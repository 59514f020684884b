"""Datasets: many samples of a varied scenario, made by any number of workers, resumable.

The store does not depend on the workers, their order or the number of runs: two stores of one
configuration are equal byte for byte.
"""

import os
import resource
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from estimator.measurement.store import PARAMETERS
from scenes.files.loading import ScenarioSource
from scenes.sampling.sample_space import SampleSpace, open_sample_space
from scenes.sampling.variations import load_variations
from simulator.dataset.config import DatasetConfig, differences, identity
from simulator.dataset.layout import Layout, dataset_layout
from simulator.dataset.sample import failed_row, make_row
from simulator.dataset.store import (
    IDENTITY,
    DatasetError,
    GrowingDataset,
)
from simulator.dataset.task_runner import (
    Result,
    Task,
    WorkError,
    Workers,
    compute_in_one_thread,
    work_off,
)
from simulator.dataset.variables import FAILED
from simulator.dataset.zarr_arrays import codec, failed_samples, stored_array

Tally = Callable[[int, int, int], None]
"""Called with the numbers of samples done (failed ones included), failed, and in all."""

COMPILING = 10.0
"""Longest time of a first sample of which kernel compilation (some seconds) may be a large part.
[s]"""

MOST_FAILURES_TOLD = 100


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A sample that could not be made."""

    sample: int
    reason: str
    parameters: Mapping[str, object]  # as drawn, without absent ones


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Result of a run."""

    samples: int
    failed: int
    failures: tuple[Failure, ...]  # the first few
    made_now: int  # samples that this run has made
    seed: int  # of all random draws


@dataclass(frozen=True, kw_only=True)
class Forecast:
    """Time, size and memory of a dataset, estimated from one sample on one thread here."""

    samples: int
    sample_seconds: float  # [s]
    sample_bytes: int  # compressed [byte]
    raw_bytes: int  # of echo and uplinks, uncompressed [byte]
    memory: int  # of one worker, at its peak [byte]
    redraws: int  # impossible draws of that sample


@dataclass(frozen=True, kw_only=True)
class DatasetJob:
    """A dataset to make: its configuration and its store."""

    source: ScenarioSource
    config: DatasetConfig
    target: Path
    identity: Mapping[str, str]

    @property
    def space(self) -> SampleSpace:
        """Sample space of the dataset."""
        return self.config.space(self.source)


def plan_dataset(config: Path | Mapping[str, Any], target: Path) -> DatasetJob:
    """Read and check a dataset's configuration, before any work.

    Parameters
    ----------
    config
        Its TOML file, or the tables of one; see :class:`simulator.dataset.config.DatasetConfig`.
        Paths in it are relative to the file, or else to the current folder.
    target
        The store to make.

    Raises
    ------
    ScenarioError
        If something is missing, unknown or impossible: a line for each problem.
    """
    told = load_variations(config, DatasetConfig)
    folder = config.parent if isinstance(config, Path) else Path.cwd()
    space = told.space(open_sample_space(told, folder).source)
    space.check()
    return DatasetJob(
        source=space.source, config=told, target=target.resolve(), identity=identity(space)
    )


def make_dataset(
    job: DatasetJob,
    *,
    workers: Workers,
    retry_failed: bool = False,
    tell: Tally | None = None,
) -> Summary:
    """Make a dataset, or resume an unfinished one.

    Parameters
    ----------
    job
        Configuration and store.
    workers
        Where samples are made. Workers on other machines need the same folder and versions.
    retry_failed
        Make samples again that have failed earlier.
    tell
        Called after each sample.

    Raises
    ------
    DatasetError
        If the path holds something else, or a dataset of another configuration or version.
    WorkError
        If the workers are lost.
    """
    layout = _layout(job)
    growing = GrowingDataset(job.target, layout)
    parent = job.target.parent
    try:
        parent.mkdir(parents=True, exist_ok=True)
        made = _grow(job, growing, workers, retry_failed, tell or (lambda *_: None))
    except OSError as error:
        raise DatasetError(
            f"cannot write {job.target}: {error.strerror or error}; free or choose another place. "
            "What was made is kept: the same command goes on"
        ) from error
    failures = tuple(_failures(job.target, layout))
    failed = sum(1 for _ in failed_samples(job.target))
    return Summary(
        samples=layout.samples,
        failed=failed,
        failures=failures,
        made_now=made,
        seed=job.config.seed,
    )


def forecast(job: DatasetJob) -> Forecast:
    """Make one sample and estimate the cost of all from it; nothing is written."""
    layout = _layout(job)
    space = job.space
    compute_in_one_thread()
    row, seconds = _timed(space, layout)
    if seconds < COMPILING:  # the first one included compilation of the kernels
        row, seconds = _timed(space, layout)
    packed = 0
    for variable in layout.variables:
        if variable.large:
            packed += _compressed_size(variable, row[variable.key])
    # Labels compress well, but they are few: counted uncompressed.
    labels = sum(row[one.key].nbytes for one in layout.variables if not one.large)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return Forecast(
        samples=layout.samples,
        sample_seconds=seconds,
        sample_bytes=packed + labels,
        raw_bytes=layout.sample_bytes,
        memory=peak if sys.platform == "darwin" else peak * 1024,
        redraws=max(int(row["redraws"]), 0),
    )


def progress_of(job: DatasetJob) -> tuple[int, int]:
    """Return the numbers of samples done and in all of an interrupted dataset."""
    growing = GrowingDataset(job.target, _layout(job))
    if job.target.exists() or not (growing.folder / "samples").exists():
        return 0, growing.layout.samples
    return int(growing.done().sum()), growing.layout.samples


def make_sample(job: DatasetJob, sample: int) -> bool:
    """Make one sample and write its file, in a worker; return whether it failed."""
    space, growing = _prepared(job)
    row = make_row(space, growing.layout, sample)
    growing.put(sample, row)
    return int(row["status"]) == FAILED


def collect_block(job: DatasetJob, block: int) -> None:
    """Move a block of samples into the store, in a worker."""
    _, growing = _prepared(job)
    growing.collect(block)


def _layout(job: DatasetJob) -> Layout:
    space = job.space
    example = space.first(0)[0].scenario
    assert example is not None  # there is one, or an exception
    return dataset_layout(space, job.config, example)


_known: dict[str, tuple[SampleSpace, GrowingDataset]] = {}  # of this worker: the last one


def _prepared(job: DatasetJob) -> tuple[SampleSpace, GrowingDataset]:
    key = f"{job.target}\0{job.identity}"
    if key not in _known:
        space = job.space
        if found := differences(identity(space), job.identity):
            raise WorkError(
                f"a worker has another {', another '.join(found)}; install the same version on "
                "all machines"
            )
        _known.clear()
        _known[key] = space, GrowingDataset(job.target, _layout(job))
    return _known[key]


def _grow(
    job: DatasetJob, growing: GrowingDataset, workers: Workers, retry_failed: bool, tell: Tally
) -> int:
    """Make the missing samples; return their number."""
    if os.path.lexists(job.target):
        _refuse_foreign(job, growing.layout)
        again = retry_failed and any(True for _ in failed_samples(job.target))
        if not again and not growing.folder.exists():
            return 0  # also if the folder is read-only
    with growing.locked():
        # Checked under the lock, when no other process works on it.
        finished = os.path.lexists(job.target)
        if finished:
            _refuse_foreign(job, growing.layout)
            if not retry_failed or not growing.reopen():
                growing.discard()  # left by a retry that was interrupted at its start
                return 0
        growing.begin()
        if retry_failed and not finished:
            growing.forget_failed()
        made = _work(job, growing, workers, tell)
        growing.finish()
    return made


def _work(job: DatasetJob, growing: GrowingDataset, workers: Workers, tell: Tally) -> int:
    layout = growing.layout
    done = growing.done()
    failed = len(growing.failed())
    collected = set(growing.collected())
    missing = np.array(
        [np.count_nonzero(~done[_slice(layout, block)]) for block in range(layout.blocks)]
    )
    ready = [b for b in range(layout.blocks) if missing[b] == 0 and b not in collected]
    made, before = 0, int(done.sum())
    tell(before, failed, layout.samples)

    def tasks() -> Iterator[Task]:
        for block in ready:
            yield _collect(job, block)
        for sample in np.flatnonzero(~done):
            yield Task(name=f"sample-{sample}", function=make_sample, arguments=(job, int(sample)))

    def on_result(task: Task, result: Result) -> Iterable[Task]:
        nonlocal made, failed
        kind, _, number = task.name.partition("-")
        if isinstance(result, Exception):
            if kind != "sample" or type(result).__name__ != "KilledWorker":
                raise result
            why = "the processes that made it were killed, each time; does it need more memory?"
            growing.put(int(number), failed_row(job.space, layout, int(number), why))
            result = True
        if kind != "sample":
            return []
        made += 1
        failed += bool(result)
        tell(before + made, failed, layout.samples)
        block = int(number) // layout.block
        missing[block] -= 1
        return [_collect(job, block)] if missing[block] == 0 else []

    work_off(tasks(), workers=workers, on_result=on_result)
    return made


def _slice(layout: Layout, block: int) -> slice:
    samples = layout.block_samples(block)
    return slice(samples.start, samples.stop)


def _collect(job: DatasetJob, block: int) -> Task:
    return Task(name=f"block-{block}", function=collect_block, arguments=(job, block))


def _refuse_foreign(job: DatasetJob, layout: Layout) -> None:
    try:
        attributes: Mapping[str, Any] = zarr.open_group(job.target, mode="r").attrs.asdict()
    except Exception:  # whatever else the file holds
        attributes = {}
    if "dataset_format" not in attributes:
        raise DatasetError(
            f"{job.target} exists and is not a dataset; move it away or choose another file"
        )
    mine = {key: str(layout.attributes[key]) for key in IDENTITY}
    theirs = {key: str(attributes.get(key)) for key in IDENTITY}
    if found := differences(mine, theirs):
        raise DatasetError(
            f"{job.target} was made with another {', another '.join(found)}; it is left as it is: "
            "move it away or choose another file"
        )


def _failures(path: Path, layout: Layout) -> Iterator[Failure]:
    group = zarr.open_group(path, mode="r")
    names = [one for one in layout.variables if one.group == PARAMETERS]
    for told, sample in enumerate(failed_samples(path)):
        if told == MOST_FAILURES_TOLD:
            return
        values = {one.name: _value(stored_array(group, one.key)[sample]) for one in names}
        yield Failure(
            sample=sample,
            reason=str(_value(stored_array(group, "failure")[sample])),
            parameters={key: value for key, value in values.items() if value is not None},
        )


def _value(stored: Any) -> object:
    values = np.asarray(stored)
    if values.dtype.kind == "f":
        return values.tolist() if np.all(np.isfinite(values)) else None
    return str(values[()]) or None


def _timed(space: SampleSpace, layout: Layout) -> tuple[dict[str, np.ndarray], float]:
    started = time.perf_counter()
    row = make_row(space, layout, 0)
    return row, time.perf_counter() - started


def _compressed_size(variable: Any, values: np.ndarray) -> int:
    stored = zarr.create_array(
        zarr.storage.MemoryStore(),
        shape=values.shape,
        dtype=values.dtype,
        chunks=values.shape,
        compressors=[codec(variable)],
    )
    stored[...] = values
    return int(stored.nbytes_stored())
