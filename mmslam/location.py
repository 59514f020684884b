"""From a measurement to an estimate, and to a folder of results.

Nothing here needs a scenario, so ``locate`` loads neither its models nor the ray tracer.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimator import localization
from estimator.measurement import model
from estimator.results.estimate import Progress
from mmslam import output, own_results
from mmslam.measurement import Measurement
from mmslam.measurement_files import read
from mmslam.plain_text import file_name
from mmslam.region import ANY, Bounds, asked_region
from mmslam.results.document import result_document, to_json
from mmslam.results.estimate import Estimate


def locate(
    measurement: model.Measurement,
    *,
    x: Bounds = ANY,
    y: Bounds = ANY,
    z: Bounds = ANY,
    pixel: float | None = None,
    min_range: float | None = None,
    max_range: float | None = None,
    images: bool = True,
    progress: Progress | None = None,
) -> Estimate:
    """Find walls, targets and users from a measurement alone.

    Parameters
    ----------
    measurement
        Measurement of a linear or a planar array; echo or uplinks may be missing. Its ground truth,
        if any, is not passed to the estimator.
    x, y, z
        First and last coordinate of where targets are looked for, in the world's frame: with any of
        these, or of the next three, that region is imaged, and no walls are looked for. [m]
    pixel
        Spacing of its pixels; None: half the finest resolution. [m]
    min_range, max_range
        Distances from the positions within which the region is chosen. [m]
    images
        Whether images and enlarged maps are available in the estimate (formed on first access); the
        estimate itself does not need them.
    progress
        Called after each stage.

    Returns
    -------
    Users, mirrors and targets in the world frame [m]; each may be empty or *not found*.

    Raises
    ------
    MeasurementError
        If the array is neither linear nor planar and pilots came to it, the frequencies are not
        uniform, or the region is empty.

    Examples
    --------
    >>> import mmslam
    >>> small = {
    ...     "base_station.elements": 48, "radio.stop_ghz": 230.0, "radio.points": 101,
    ...     "objects.wall.centre_m": [0.0, 0.4], "objects.wall.length_m": 0.2,
    ...     "users.user.position_m": [0.5, 0.4],
    ... }
    >>> measurement = mmslam.simulate(mmslam.load_scenario("slam_2d", small), seed=1)
    >>> estimate = mmslam.locate(measurement)
    >>> estimate.users["user"].status, estimate.users["user"].bounces
    ('found', 1)
    >>> off = estimate.users["user"].position - measurement.truth.user_position["user"]
    >>> bool(abs(off).max() < 4 * estimate.users["user"].uncertainty_m)
    True
    """
    seen = measurement.without_truth() if isinstance(measurement, Measurement) else measurement
    region = asked_region(x=x, y=y, z=z, pixel=pixel, near=min_range, far=max_range)
    found = localization.locate(seen, region=region, images=images, progress=progress)
    return Estimate.of(found, seen)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a command has written, and where."""

    folder: Path
    result: Mapping[str, Any]


def locate_measurement(
    path: Path,
    *,
    sample: int | None,
    folder: Path | None,
    progress: Progress | None = None,
    **asked: Any,
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
        Called with each stage's steps.
    asked
        A region, as :func:`locate` takes it.
    """
    measurement = read(path, sample=sample)
    folder = folder or default_folder(measurement, path, sample)
    output.refuse_to_replace_input(folder, path)
    with output.replacing(folder, own_results.refuse_foreign_results) as new:
        new.mkdir()
        estimate = locate(measurement, progress=progress, **asked)
        result = write_results(new, measurement, estimate, {}, None)
    return Outcome(folder=folder, result=result)


def default_folder(measurement: Measurement, path: Path, sample: int | None) -> Path:
    """Name the folder for the estimate of a file: never the one of the run that wrote it."""
    parts = [file_name(measurement.scenario or path.stem)]
    if measurement.seed is not None:
        parts.append(str(measurement.seed))
    if sample is not None:
        parts.append(f"sample{sample}")
    return Path("out") / "-".join([*parts, "located"])


def write_results(
    new: Path,
    measurement: Measurement,
    estimate: Estimate,
    timings: dict[str, float],
    scenario: str | None,
) -> Mapping[str, Any]:
    """Draw the figures, and write them with the result and the report; the scenario is its TOML."""
    # matplotlib's import takes half a second that other commands need not wait.
    from mmslam.results.page.plan import plan_document
    from mmslam.results.page.single_file import can_draw
    from mmslam.results.pictures_2d import write_pictures
    from mmslam.results.report import render_report

    truth = measurement.truth  # opened now, after the estimate
    started = time.perf_counter()
    pictures = write_pictures(new, measurement, estimate, truth)
    timings = {**timings, "figures": time.perf_counter() - started}
    result = result_document(measurement, estimate, truth, timings=timings)
    plan = None
    if can_draw():
        plan = plan_document(measurement, estimate, truth, dimensions=result["dimensions"])
    report = render_report(result, measurement, pictures, scenario=scenario, plan=plan)
    (new / own_results.REPORT).write_text(report, encoding="utf-8")
    (new / own_results.RESULT).write_text(to_json(result), encoding="utf-8")
    return result
