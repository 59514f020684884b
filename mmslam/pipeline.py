"""Joins the packages: scenario, measurement, estimate, comparison, figures, report."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimator.localization.pipeline import locate
from estimator.measurement.model import Measurement
from estimator.measurement.store import read_measurement, write_measurement
from estimator.results.estimate import Estimate, Progress
from mmslam import output
from mmslam.measurement_files import simulate_interruptibly
from mmslam.results.document import result_document, to_json
from scenes.scenario import Scenario, ScenarioError
from validation.metrics.truth import Truth, read_truth, truth_from_dataset


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a command has written, and where."""

    folder: Path
    result: Mapping[str, Any]


def run_scenario(
    scenario: Scenario, *, seed: int, folder: Path, progress: Progress | None = None
) -> Outcome:
    """Simulate a scenario, estimate what is in it, and write everything to a folder.

    Parameters
    ----------
    scenario
        What is simulated.
    seed
        Of roughness and noise.
    folder
        Is replaced as a whole once all is done; refused before any work if it is foreign.
    progress
        Told each stage's steps.

    Raises
    ------
    ScenarioError
        If the estimator could not take the measurement; said before it is simulated.
    """
    _refuse_what_cannot_be_located(scenario)
    with output.replacing(folder, output.refuse_foreign_results) as new:
        new.mkdir()
        started = time.perf_counter()
        measurement, true_scene = simulate_interruptibly(scenario, seed=seed, progress=progress)
        timings = {"simulate": time.perf_counter() - started}
        started = time.perf_counter()
        write_measurement(new / output.MEASUREMENT, measurement, truth=true_scene)
        timings["write_measurement"] = time.perf_counter() - started
        truth = truth_from_dataset(true_scene)
        estimate = locate(measurement, progress=progress)
        result = _write_results(new, measurement, estimate, truth, timings, scenario)
    return Outcome(folder=folder, result=result)


def _refuse_what_cannot_be_located(scenario: Scenario) -> None:
    if scenario.base_station.multistatic:
        raise ScenarioError(
            f"scenario {scenario.name!r}: its antennas stand apart (base_station.receivers or "
            "transmitter); mirrors and users are located with a linear array that hears its own "
            "echo. `mmslam simulate` takes any antennas"
        )
    along, up = scenario.base_station.shape
    if along < 2:
        raise ScenarioError(
            f"base_station.elements: {along} × {up}; mirrors and users are located with a linear "
            "array of at least 2 elements, or a planar one of at least 2 × 2. `mmslam simulate` "
            "takes any array"
        )
    if up > 1 and scenario.base_station.transmit_offset is not None:
        raise ScenarioError(
            "base_station.transmit_offset_m: a planar array images its own echo only; leave the "
            "offset out. `mmslam simulate` takes any antennas"
        )


def locate_measurement(
    path: Path, *, sample: int | None, folder: Path | None, progress: Progress | None = None
) -> Outcome:
    """Estimate what is in a measurement file, and write it to a folder.

    Parameters
    ----------
    path
        The measurement store; its truth, if any, is opened after the estimate only.
    sample
        Which one of a dataset.
    folder
        As in :func:`run_scenario`; None: ``out/SCENARIO-SEED-located``.
    progress
        Told each stage's steps.
    """
    measurement = read_measurement(path, sample=sample)
    folder = folder or default_folder(measurement, path, sample)
    output.refuse_to_replace_input(folder, path)
    with output.replacing(folder, output.refuse_foreign_results) as new:
        new.mkdir()
        estimate = locate(measurement, progress=progress)
        truth = read_truth(path, sample=sample)
        result = _write_results(new, measurement, estimate, truth, {}, None)
    return Outcome(folder=folder, result=result)


def default_folder(measurement: Measurement, path: Path, sample: int | None) -> Path:
    """Name the folder for the estimate of a file: never the one of the run that wrote it."""
    parts = [measurement.scenario or path.stem]
    if measurement.seed is not None:
        parts.append(str(measurement.seed))
    if sample is not None:
        parts.append(f"sample{sample}")
    return Path("out") / "-".join([*parts, "located"])


def _write_results(
    new: Path,
    measurement: Measurement,
    estimate: Estimate,
    truth: Truth,
    timings: dict[str, float],
    scenario: Scenario | None,
) -> Mapping[str, Any]:
    # matplotlib's import takes half a second that other commands need not wait.
    from mmslam.results.pictures_2d import write_pictures
    from mmslam.results.report import render_report

    started = time.perf_counter()
    pictures = write_pictures(new, measurement, estimate, truth)
    timings = {**timings, "figures": time.perf_counter() - started}
    result = result_document(measurement, estimate, truth, timings=timings)
    report = render_report(result, measurement, pictures, scenario=scenario)
    (new / output.REPORT).write_text(report, encoding="utf-8")
    (new / output.RESULT).write_text(to_json(result), encoding="utf-8")
    return result
