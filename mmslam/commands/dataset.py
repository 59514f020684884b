"""The command ``dataset``: simulation of many samples into one store, and its messages."""

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from mmslam.output import OutputError
from mmslam.plain_text import visible
from mmslam.terminal.interruption import ResumableInterruption, interruptions_held
from mmslam.terminal.task_progress import WorkProgress, told_size, told_time
from simulator.dataset import builder
from simulator.dataset.builder import Forecast, Summary
from simulator.dataset.store import DatasetError
from simulator.dataset.task_runner import WorkError, Workers

_TOLD_FAILURES = 10


def make_dataset(
    config: str | Path | Mapping[str, Any],
    path: str | Path,
    *,
    workers: int = 0,
    scheduler: str | None = None,
    retry_failed: bool = False,
    progress: builder.Tally | None = None,
) -> Summary:
    """Simulate many variations of a scenario into one store, or resume an unfinished one.

    Parameters
    ----------
    config
        A TOML file, or its tables (see ``mmslam dataset --schema``).
    path
        The store to make; open it by :func:`mmslam.open_dataset`.
    workers
        Processes; 0: this one. With more, a script needs ``if __name__ == "__main__":`` around it.
    scheduler
        Address of a Dask scheduler, whose workers are used instead.
    retry_failed
        Make samples again that have failed.
    progress
        Called with the numbers of samples done, failed, and in all.

    Returns
    -------
    The numbers of samples in all, failed, and made by this call.

    Raises
    ------
    ScenarioError
        If the configuration is wrong.
    OutputError
        If the store cannot be written, or its workers are lost.
    ResumableInterruption
        On Ctrl-C; the message says how to resume.

    Examples
    --------
    >>> import mmslam
    >>> config = {
    ...     "base": "point_scatterers",
    ...     "count": 3,
    ...     "set": {"base_station.elements": 8, "radio.points": 8},
    ...     "vary": {"noise.snr_db": {"kind": "uniform", "low": 10, "high": 30}},
    ... }
    >>> made = mmslam.make_dataset(config, "some.zarr")
    >>> made.samples, made.failed
    (3, 0)
    """
    given = config if isinstance(config, Mapping) else Path(config)
    job = builder.plan_dataset(given, Path(path))
    where = Workers(processes=workers, scheduler=scheduler)
    tell = progress or (lambda done, failed, total: None)
    with _errors_told():
        try:
            if not where.in_this_process:
                return builder.make_dataset(
                    job, workers=where, retry_failed=retry_failed, tell=tell
                )
            with interruptions_held() as let_through:

                def step(done: int, failed: int, total: int) -> None:
                    tell(done, failed, total)
                    let_through()

                return builder.make_dataset(
                    job, workers=where, retry_failed=retry_failed, tell=step
                )
        except KeyboardInterrupt:
            done, samples = builder.progress_of(job)
            raise ResumableInterruption(
                f"interrupted; {done} of {samples} samples are done: the same command goes on"
            ) from None


def make(config: Path, target: Path, *, workers: Workers, retry_failed: bool) -> Mapping[str, Any]:
    """Make a dataset with its progress on stderr; return the document for JSON."""
    with WorkProgress("samples") as progress:
        summary = make_dataset(
            config,
            target,
            workers=workers.processes,
            scheduler=workers.scheduler,
            retry_failed=retry_failed,
            progress=progress,
        )
    return {"file": str(target), **_document(summary)}


def look_ahead(config: Path, target: Path, *, workers: int) -> Mapping[str, Any]:
    """Estimate time, size and memory of a dataset from one sample; return the JSON document."""
    job = builder.plan_dataset(config, target)
    with _errors_told():
        found = builder.forecast(job)
    return _forecast_document(found, target, workers)


def lines(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines that describe the document of :func:`make`."""
    yield (
        f"{document['file']}: {document['samples']} samples, {document['failed']} failed"
        + (f", {document['made_now']} made now" if document["made_now"] else "")
    )
    for failure in document["failures"][:_TOLD_FAILURES]:
        values = ", ".join(f"{key} = {value}" for key, value in failure["parameters"].items())
        yield f"  sample {failure['sample']} failed: {failure['reason']} ({values or 'as it is'})"
    if document["failed"] > _TOLD_FAILURES:
        yield f"  … and {document['failed'] - _TOLD_FAILURES} more; see `failure` in the file"
    if document["failed"]:
        yield "  `--retry-failed` makes them again"


def forecast_lines(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines that describe the document of :func:`look_ahead`."""
    workers, seconds = document["workers"], document["sample_s"]
    yield f"{document['samples']} samples, {seconds:.3g} s each on one thread"
    yield f"time    {told_time(document['time_s'])} with {workers} workers of this machine"
    yield (
        f"size    {told_size(document['size_bytes'])} "
        f"({told_size(document['sample_bytes'])} a sample, "
        f"{document['sample_bytes'] / document['raw_bytes']:.2f} of its echo and uplinks)"
    )
    yield f"free    {told_size(document['free_bytes'])}"
    yield (
        f"memory  {told_size(document['memory_bytes'])} "
        f"({told_size(document['worker_memory_bytes'])} a worker)"
    )
    if document["size_bytes"] > document["free_bytes"]:
        yield "There is not enough space: free some, or give a smaller count"


def chosen_workers(processes: int | None, scheduler: str | None) -> Workers:
    """Return the workers: a Dask scheduler's, or local processes, by default one for each core."""
    if scheduler is not None and processes is not None:
        raise typer.BadParameter("--workers is for this machine's; with --scheduler leave it out")
    return Workers(processes=_processors() if processes is None else processes, scheduler=scheduler)


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def _errors_told() -> Iterator[None]:
    try:
        yield
    except (DatasetError, WorkError) as error:
        raise OutputError(str(error)) from error


def _document(summary: Summary) -> dict[str, Any]:
    return {
        "samples": summary.samples,
        "failed": summary.failed,
        "made_now": summary.made_now,
        "seed": summary.seed,
        "failures": [
            {"sample": one.sample, "reason": one.reason, "parameters": dict(one.parameters)}
            for one in summary.failures
        ],
    }


def _forecast_document(found: Forecast, target: Path, workers: int) -> dict[str, Any]:
    place = target.resolve().parent
    while not place.exists():
        place = place.parent
    return {
        "samples": found.samples,
        "workers": workers,
        "sample_s": found.sample_seconds,
        "time_s": found.samples * found.sample_seconds / workers,
        "sample_bytes": found.sample_bytes,
        "raw_bytes": found.raw_bytes,
        "size_bytes": found.samples * found.sample_bytes,
        "free_bytes": shutil.disk_usage(place).free,
        "worker_memory_bytes": found.memory,
        "memory_bytes": workers * found.memory,
        "redraws": found.redraws,
    }


def print_lines(told: Iterator[str]) -> None:
    """Print lines on stdout."""
    for line in told:
        typer.echo(visible(line))
