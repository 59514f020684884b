"""Running sweeps: what the command does, writes and says."""

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from estimator.measurement.store import is_store
from mmslam import output
from mmslam.terminal.interruption import ResumableInterruption, interruptions_held
from mmslam.terminal.task_progress import WorkProgress, told_time
from simulator.dataset.task_runner import WorkError, Workers, compute_in_one_thread
from validation.sweep.sweep import (
    Outcome,
    SweepConfig,
    SweepJob,
    missing_points,
    plan_sweep,
    run_point,
    run_sweep,
    statistics,
)
from validation.sweep.tables import error_dataset, error_table

SUMMARY, TABLE, STORE = "sweep.json", "errors.csv", "errors.zarr"
FIGURES = ("errors.png", "distribution.png")
DEFAULT_CACHE = Path("out") / "sweep_cache"


def run(config: Path, folder: Path, *, cache: Path, workers: Workers) -> Mapping[str, Any]:
    """Run a sweep, write its tables and figures, and return its summary.

    Raises
    ------
    ScenarioError
        If the configuration is wrong.
    OutputError
        If the folder cannot be written, or the workers are lost.
    ResumableInterruption
        On Ctrl-C: what was computed is kept.
    """
    job = plan_sweep(config, cache)
    with output.replacing(folder, refuse_foreign_sweep) as new:
        outcomes = _computed(job, workers)
        new.mkdir()
        summary = _summary(job.config, outcomes)
        (new / TABLE).write_text(error_table(outcomes, job.space), encoding="utf-8")
        error_dataset(outcomes, job.config).to_zarr(new / STORE, zarr_format=3, consolidated=False)
        _write_figures(new, job.config, outcomes)
        (new / SUMMARY).write_text(json.dumps(summary, indent=2), encoding="utf-8")
    return {"folder": str(folder), **summary}


def look_ahead(config: Path, *, cache: Path, workers: int) -> Mapping[str, Any]:
    """Judge by one point what a sweep will take; return the document for JSON."""
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
    """Say what :func:`look_ahead` has returned."""
    yield f"{document['points']} points, {document['missing']} of them not computed yet"
    if document["missing"]:
        yield (
            f"time    {told_time(document['time_s'])} at most, with {document['workers']} workers "
            f"({document['point_s']:.3g} s for the first point, which is kept)"
        )


def lines(document: Mapping[str, Any]) -> Iterator[str]:
    """Say what :func:`run` has returned."""
    yield f"{document['folder']}: {document['points']} points, {document['failed']} failed"
    yield f"{'median/mm':>10} {'90 %/mm':>10} {'worst/mm':>10} {'bound/mm':>10} {'found':>6}"
    for case in document["cases"]:
        errors = [
            "-" if value is None else f"{1e3 * value:.3f}"
            for value in (case["median_m"], case["most_m"], case["worst_m"], _told_bound(case))
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


def _computed(job: SweepJob, workers: Workers) -> tuple[Outcome, ...]:
    try:
        with WorkProgress("points") as progress:
            if not workers.in_this_process:
                return run_sweep(job, workers=workers, tell=progress)
            with interruptions_held() as let_through:

                def step(done: int, failed: int, total: int) -> None:
                    progress(done, failed, total)
                    let_through()

                return run_sweep(job, workers=workers, tell=step)
    except WorkError as error:
        raise output.OutputError(str(error)) from error
    except KeyboardInterrupt:
        raise ResumableInterruption(
            f"interrupted; what was computed is kept in {job.cache}: the same command goes on"
        ) from None


def _summary(config: SweepConfig, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    cases: dict[int, list[Outcome]] = {}
    for one in outcomes:
        cases.setdefault(one.point % config.grid_size, []).append(one)
    keys = [key for axis in config.grid for key in axis]
    failed = {one.point: one.reason for one in outcomes if one.status == "failed"}
    return {
        "format": 1,
        "title": config.title,
        "seed": config.seed,
        "points": config.points,
        "realisations": config.realisations,
        "failed": len(failed),
        "failures": [{"point": point, "reason": why} for point, why in failed.items()],
        "cases": [
            {
                "parameters": {key: case[0].parameters[key] for key in keys},
                **_numbers(case),
                "found": sum(one.status == "found" for one in case) / len(case),
            }
            for _, case in sorted(cases.items())
        ],
    }


def _told_bound(case: Mapping[str, Any]) -> float | None:
    """Return the bound that holds for a wall that is found; with no rough wall, the other."""
    told: float | None = case["bound_with_walls_m"]
    known: float | None = case["bound_m"]
    return known if told is None else told


def _numbers(case: Sequence[Outcome]) -> dict[str, float | None]:
    found = dict(
        zip(
            ("median_m", "most_m", "worst_m"),
            statistics([one.located for one in case]),
            strict=True,
        )
    )
    for field in ("bound", "bound_with_walls"):
        known = [value for one in case if (value := getattr(one, field)) is not None]
        found[f"{field}_m"] = float(np.median(known)) if known else np.inf
    return {key: value if np.isfinite(value) else None for key, value in found.items()}


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
    figure.savefig(folder / FIGURES[0], dpi=DOTS_PER_INCH, metadata={"Software": None})
    figure = Figure(figsize=(7.5, 5), layout="constrained")
    draw_distribution(figure.add_subplot(), outcomes, config)
    figure.suptitle(config.title)
    figure.savefig(folder / FIGURES[1], dpi=DOTS_PER_INCH, metadata={"Software": None})
