"""The command ``sweep``: location errors over a grid of parameters, its files and messages."""

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from estimator.measurement.store import is_store
from mmslam import output
from mmslam.plain_text import drawn_plainly
from mmslam.results.sweeps import Sweep, told_bound
from mmslam.terminal.interruption import ResumableInterruption, interruptions_held
from mmslam.terminal.task_progress import WorkProgress, told_time
from simulator.dataset.task_runner import WorkError, Workers, compute_in_one_thread
from validation.sweep.sweep import (
    Outcome,
    SweepConfig,
    SweepJob,
    Tally,
    missing_points,
    plan_sweep,
    run_point,
    run_sweep,
)
from validation.sweep.tables import error_table

SUMMARY, TABLE, STORE = "sweep.json", "errors.csv", "errors.zarr"
FIGURES = ("errors.png", "distribution.png")
DEFAULT_CACHE = Path("out") / "sweep_cache"


def sweep(
    config: str | Path | Mapping[str, Any],
    *,
    folder: str | Path | None = None,
    cache: str | Path = DEFAULT_CACHE,
    workers: int = 0,
    scheduler: str | None = None,
    progress: Tally | None = None,
) -> Sweep:
    """Locate users over a grid of a scenario's keys, in many realisations of roughness and noise.

    Parameters
    ----------
    config
        A TOML file, or its tables (see ``mmslam sweep --schema``).
    folder
        Where tables and figures are written; an earlier sweep's are replaced, anything else is
        refused. None: nowhere.
    cache
        Folder of computed points: the same sweep resumes, an extended one computes only new points.
    workers
        Processes; 0: this one. With more, a script needs ``if __name__ == "__main__":`` around it.
    scheduler
        Address of a Dask scheduler, whose workers are used instead.
    progress
        Called with the numbers of points done, failed, and in all.

    Raises
    ------
    ScenarioError
        If the configuration is wrong.
    OutputError
        If the folder cannot be written, or the workers are lost.
    ResumableInterruption
        On Ctrl-C: what was computed is kept.

    Examples
    --------
    >>> import mmslam
    >>> config = {
    ...     "base": "slam_2d",
    ...     "realisations": 1,
    ...     "set": {
    ...         "base_station.elements": 48, "radio.stop_ghz": 230.0, "radio.points": 101,
    ...         "objects.wall.centre_m": [0.0, 0.4], "objects.wall.length_m": 0.2,
    ...         "users.user.position_m": [0.5, 0.4],
    ...     },
    ...     "vary": {"noise.snr_db": {"kind": "grid", "values": [20, 30]}},
    ... }
    >>> result = mmslam.sweep(config, cache="cache")
    >>> [case["found"] for case in result.summary()["cases"]]
    [1.0, 1.0]
    """
    given = config if isinstance(config, Mapping) else Path(config)
    job = plan_sweep(given, Path(cache))
    where = Workers(processes=workers, scheduler=scheduler)
    if folder is None:
        return Sweep(config=job.config, outcomes=_computed(job, where, progress))
    with output.replacing(Path(folder), refuse_foreign_sweep) as new:
        found = Sweep(config=job.config, outcomes=_computed(job, where, progress))
        new.mkdir()
        _write(new, found, job)
    return found


def run(config: Path, folder: Path, *, cache: Path, workers: Workers) -> Mapping[str, Any]:
    """Run a sweep with its progress on stderr; return the document for JSON."""
    with WorkProgress("points") as progress:
        found = sweep(
            config,
            folder=folder,
            cache=cache,
            workers=workers.processes,
            scheduler=workers.scheduler,
            progress=progress,
        )
    return {"folder": str(folder), **found.summary()}


def look_ahead(config: Path, *, cache: Path, workers: int) -> Mapping[str, Any]:
    """Estimate the time of a sweep from one point; return the JSON document."""
    job = plan_sweep(config, cache)
    missing = missing_points(job)
    seconds = 0.0
    if missing:
        compute_in_one_thread()
        began = time.perf_counter()
        run_point(job, missing[0])
        seconds = time.perf_counter() - began
    return {
        "points": job.config.points,
        "missing": len(missing),
        "point_s": seconds,
        "time_s": len(missing) * seconds / workers,
        "workers": workers,
    }


def forecast_lines(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines that describe the document of :func:`look_ahead`."""
    yield f"{document['points']} points, {document['missing']} of them not computed yet"
    if document["missing"]:
        yield (
            f"time    {told_time(document['time_s'])} at most, with {document['workers']} workers "
            f"({document['point_s']:.3g} s for the first point, which is kept)"
        )


def lines(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines that describe the document of :func:`run`."""
    yield f"{document['folder']}: {document['points']} points, {document['failed']} failed"
    yield f"{'median/mm':>10} {'90 %/mm':>10} {'worst/mm':>10} {'bound/mm':>10} {'found':>6}"
    for case in document["cases"]:
        errors = [
            "-" if value is None else f"{1e3 * value:.3f}"
            for value in (case["median_m"], case["most_m"], case["worst_m"], told_bound(case))
        ]
        values = ", ".join(f"{key} = {value}" for key, value in case["parameters"].items())
        told = " ".join(f"{error:>10}" for error in errors)
        yield f"{told} {100 * case['found']:>5.0f}%  {values}"
    for failure in document["failures"][:10]:
        yield f"  point {failure['point']} failed: {failure['reason']}"
    if document["failed"]:
        yield "  the same command tries the failed ones again"


def refuse_foreign_sweep(folder: Path) -> str | None:
    """Say why a folder may not be replaced by a sweep's results; None if it is an earlier one's."""
    names = {entry.name for entry in folder.iterdir() if not entry.name.startswith(".")}
    if names - {SUMMARY, TABLE, STORE, *FIGURES}:
        return "it holds what no sweep of mmslam wrote"
    if names and not (folder / SUMMARY).is_file():
        return f"no sweep of mmslam made it (no {SUMMARY} in it)"
    if (folder / STORE).exists() and not is_store(folder / STORE):
        return f"its {STORE} is not a store of ours"
    return None


def _computed(job: SweepJob, workers: Workers, progress: Tally | None) -> tuple[Outcome, ...]:
    tell = progress or (lambda done, failed, total: None)
    try:
        if not workers.in_this_process:
            return run_sweep(job, workers=workers, tell=tell)
        with interruptions_held() as let_through:

            def step(done: int, failed: int, total: int) -> None:
                tell(done, failed, total)
                let_through()

            return run_sweep(job, workers=workers, tell=step)
    except WorkError as error:
        raise output.OutputError(str(error)) from error
    except KeyboardInterrupt:
        raise ResumableInterruption(
            f"interrupted; what was computed is kept in {job.cache}: the same command goes on"
        ) from None


def _write(new: Path, found: Sweep, job: SweepJob) -> None:
    (new / TABLE).write_text(error_table(found.outcomes, job.space), encoding="utf-8")
    found.to_xarray().to_zarr(new / STORE, zarr_format=3, consolidated=False)
    _write_figures(new, job.config, found.outcomes)
    (new / SUMMARY).write_text(json.dumps(found.summary(), indent=2), encoding="utf-8")


def _write_figures(folder: Path, config: SweepConfig, outcomes: Sequence[Outcome]) -> None:
    from matplotlib.figure import Figure

    from mmslam.results.pictures_2d import DOTS_PER_INCH
    from validation.sweep.figures import draw_distribution, draw_errors, draw_found

    figure = Figure(figsize=(7.5, 7), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[4, 1])
    draw_errors(upper, outcomes, config)
    upper.set_xlabel("")
    draw_found(lower, outcomes, config)
    figure.suptitle(config.title)
    drawn_plainly(figure)
    figure.savefig(folder / FIGURES[0], dpi=DOTS_PER_INCH, metadata={"Software": None})
    figure = Figure(figsize=(7.5, 5), layout="constrained")
    draw_distribution(figure.add_subplot(), outcomes, config)
    figure.suptitle(config.title)
    drawn_plainly(figure)
    figure.savefig(folder / FIGURES[1], dpi=DOTS_PER_INCH, metadata={"Software": None})
