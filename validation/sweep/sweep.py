"""Sweeps: position errors over a grid of a scenario's keys and many realisations.

Each point is simulated, estimated and compared independently, and its outcome cached under a digest
of all that it depends on. So an interrupted sweep resumes, an extended one computes only new
points, and points that differ only in noise share the noise-free measurement.
"""

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from estimator.results.estimate import Estimate, UserEstimate
from scenes.files.loading import ScenarioSource
from scenes.sampling.sample_space import SampleSpace, open_sample_space
from scenes.sampling.variations import Variations, load_variations
from scenes.scenario import Scenario
from scenes.schema.objects import Plate
from simulator.dataset.task_runner import Result, Task, Workers, work_off
from simulator.scene.truth import scenario_truth
from validation.bounds.no_bound import NoBound
from validation.bounds.roughness_floor import roughness_floor
from validation.bounds.scenario_bound import scenario_position_bound, user_waves
from validation.bounds.wall_bound import wall_covariance_bound
from validation.metrics.errors import position_error, wall_errors
from validation.metrics.truth import Truth, truth_from_dataset
from validation.sweep.noise_free import content_key, noise_free, with_receiver

PACKAGES = ("scenes", "simulator", "estimator", "validation")
"""Our packages on whose code an outcome depends."""

Tally = Callable[[int, int, int], None]
"""Called with the numbers of points done (failed ones included), failed, and in all."""


class SweepConfig(Variations):
    """Contents of a sweep's TOML file."""

    title: str = Field("", max_length=200, description="what it shows, in a line")
    realisations: int = Field(
        10, ge=1, le=100_000, description="how often each point is drawn: roughness and noise"
    )
    axis: str | None = Field(
        None, description="the key along the figures' axis [the first that is a grid or a list]"
    )
    label: str | None = Field(None, description="what the axis is called [the key]")
    places: Annotated[tuple[float, ...], Field(strict=False)] | None = Field(
        None, description="where the axis' values stand along it [as they are]"
    )
    logarithmic: bool = Field(False, description="whether the axis is logarithmic")

    @model_validator(mode="after")
    def _sweeps_something(self) -> "SweepConfig":
        if not self.grid:
            raise PydanticCustomError(
                "sweep", "vary has neither a grid nor a list; give a key of kind = 'grid'"
            )
        if self.count is not None:
            raise PydanticCustomError(
                "sweep",
                "count = {count}: a sweep has its grid times realisations; remove it",
                {"count": self.count},
            )
        keys = [key for axis in self.grid for key in axis]
        if self.axis is not None and self.axis not in keys:
            raise PydanticCustomError(
                "axis",
                "axis = '{axis}' is not swept; give one of {keys}",
                {"axis": self.axis, "keys": ", ".join(keys)},
            )
        values = self.swept_values
        if self.places is not None and len(self.places) != len(values):
            raise PydanticCustomError(
                "places",
                "places has {places} numbers for the {count} values of {axis}; give one for each",
                {"places": len(self.places), "count": len(values), "axis": self.swept},
            )
        return self

    @property
    def swept_values(self) -> tuple[object, ...]:
        """The values along the figures' axis."""
        return self.vary[self.swept].extremes()

    @property
    def points(self) -> int:
        """Number of points: the grid times the realisations."""
        return self.grid_size * self.realisations

    @property
    def swept(self) -> str:
        """The key along the figures' axis."""
        return self.axis or next(iter(self.grid))[0]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result for one user at one point: status, error and bounds."""

    point: int
    realisation: int
    parameters: Mapping[str, object]  # as drawn, by key
    user: str
    status: str  # found, not_found, ambiguous, or failed
    reason: str | None
    error: float | None  # [m]
    deviation: float | None  # stated by the estimate [m]
    bound: float | None  # position error bound, the walls known [m]
    bound_with_walls: float | None  # with rough walls, estimated from their echo [m]
    wall_angle: float | None  # error of the detected wall [rad]
    wall_offset: float | None  # likewise [m]

    @property
    def located(self) -> float | None:
        """Error of a user with the status found; None otherwise. [m]."""
        return self.error if self.status == "found" else None


@dataclass(frozen=True, kw_only=True)
class SweepJob:
    """A sweep to run."""

    source: ScenarioSource
    config: SweepConfig
    cache: Path

    @property
    def space(self) -> SampleSpace:
        """Sample space of the points."""
        return SampleSpace(self.source, self.config)


def plan_sweep(config: Path | Mapping[str, Any], cache: Path) -> SweepJob:
    """Read and check a sweep's configuration, before any work.

    Parameters
    ----------
    config
        Its TOML file, or the tables of one; see :class:`SweepConfig`. Paths in it are relative to
        the file, or else to the current folder.
    cache
        Folder for noise-free measurements and outcomes.

    Raises
    ------
    ScenarioError
        If something is missing, unknown or impossible: a line for each problem.
    """
    told = load_variations(config, SweepConfig)
    space = open_sample_space(told, config.parent if isinstance(config, Path) else Path.cwd())
    space.check()
    return SweepJob(source=space.source, config=told, cache=cache.resolve())


def run_sweep(job: SweepJob, *, workers: Workers, tell: Tally | None = None) -> tuple[Outcome, ...]:
    """Run the missing points of a sweep.

    Parameters
    ----------
    job
        The sweep.
    workers
        Where points are computed; workers on other machines need the same folder and versions.
    tell
        Called after each point.

    Returns
    -------
    The outcomes of all points and users, in order. Failed points are repeated by the next run.

    Raises
    ------
    WorkError
        If the workers are lost.
    """
    total = job.config.points
    tell = tell or (lambda *_: None)
    failed: dict[int, str] = {}
    keys = _outcome_files(job)
    missing = [point for point, path in enumerate(keys) if not path.exists()]
    done = total - len(missing)
    tell(done, 0, total)

    def on_result(task: Task, result: Result) -> Iterable[Task]:
        nonlocal done
        done += 1
        if isinstance(result, Exception):
            failed[int(task.name.partition("-")[2])] = f"{type(result).__name__}: {result}"
        tell(done, len(failed), total)
        return []

    tasks = (
        Task(name=f"point-{point}", function=run_point, arguments=(job, point)) for point in missing
    )
    work_off(tasks, workers=workers, on_result=on_result)
    return tuple(
        outcome
        for point, path in enumerate(keys)
        for outcome in _outcomes(job, point, path, failed.get(point))
    )


def missing_points(job: SweepJob) -> list[int]:
    """Return the points without a cached outcome."""
    return [point for point, path in enumerate(_outcome_files(job)) if not path.exists()]


def run_point(job: SweepJob, point: int) -> None:
    """Simulate, estimate and compare one point, and cache the outcome; in a worker."""
    scenario = _scenario(job, point)
    path = _outcome_file(job, scenario, point)
    seed, sample = job.config.seed, point // job.config.grid_size
    quiet = noise_free(scenario, seed=seed, sample=sample, folder=job.cache / "noise_free")
    from estimator.localization.pipeline import locate

    noisy = with_receiver(quiet, scenario, seed=seed, sample=sample)
    estimate = locate(noisy, images=False)
    truth = truth_from_dataset(scenario_truth(scenario))
    found = [_compared(scenario, user, estimate, truth) for user in estimate.users]
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(
        "w", dir=path.parent, prefix=".", suffix=".part", delete=False, encoding="utf-8"
    ) as part:
        json.dump(found, part)
        part.flush()
        os.fsync(part.fileno())
    Path(part.name).rename(path)


def statistics(errors: Sequence[float | None]) -> tuple[float, float, float]:
    """Return median, 90 % and worst of errors; an unknown one counts as infinite.

    A percentile is the smallest error not exceeded in that share of the cases, so that it is
    finite if that share was found.

    Parameters
    ----------
    errors
        None: not found. [m]
    """
    values = np.sort([np.inf if error is None else error for error in errors])
    ranks = [int(np.ceil(share * len(values))) - 1 for share in (0.5, 0.9, 1.0)]
    median, most, worst = (float(values[max(rank, 0)]) for rank in ranks)
    return median, most, worst


def _scenario(job: SweepJob, point: int) -> Scenario:
    scenario = job.space.first(point)[0].scenario
    assert scenario is not None  # there is one, or an exception
    return scenario


def _outcome_files(job: SweepJob) -> list[Path]:
    return [_outcome_file(job, _scenario(job, point), point) for point in range(job.config.points)]


def _outcome_file(job: SweepJob, scenario: Scenario, point: int) -> Path:
    key = content_key(
        scenario,
        seed=job.config.seed,
        sample=point // job.config.grid_size,
        packages=PACKAGES,
    )
    return job.cache / "outcomes" / key[:2] / f"{key}.json"


def _outcomes(job: SweepJob, point: int, path: Path, problem: str | None) -> Iterator[Outcome]:
    attempt, _ = job.space.first(point)
    assert attempt.scenario is not None
    common: dict[str, Any] = {
        "point": point,
        "realisation": point // job.config.grid_size,
        "parameters": {
            one.key: attempt.values[one.key]
            for one in job.space.parameters
            if one.key in attempt.values
        },
    }
    if problem is None:
        for found in json.loads(path.read_text(encoding="utf-8")):
            yield Outcome(**common, **found)
        return
    unknown = ("error", "deviation", "bound", "bound_with_walls", "wall_angle", "wall_offset")
    nothing: dict[str, Any] = dict.fromkeys(unknown)
    for user in attempt.scenario.users:
        yield Outcome(**common, user=user, status="failed", reason=problem, **nothing)


def _compared(
    scenario: Scenario, user: UserEstimate, estimate: Estimate, truth: Truth
) -> dict[str, object]:
    walls = [error for error in wall_errors(estimate.mirrors, truth) if error is not None]
    # The detected wall is the mirror that covers the largest share of a true one.
    best = max(walls, key=lambda error: error.covered, default=None)
    known, told = position_bounds(scenario, user.name)
    covariance = user.covariance
    return {
        "user": user.name,
        "status": user.status,
        "reason": user.reason,
        "error": position_error(user.position, truth.user_position.get(user.name)),
        "deviation": None if covariance is None else float(np.sqrt(np.trace(covariance))),
        "bound": known,
        "bound_with_walls": told,
        "wall_angle": None if best is None else best.angle,
        "wall_offset": None if best is None else best.offset,
    }


def position_bounds(scenario: Scenario, user: str) -> tuple[float | None, float | None]:
    """Return the position error bound with known walls, and with walls estimated from their echo.

    Parameters
    ----------
    scenario
        Of the point.
    user
        Its name.

    Returns
    -------
    Standard deviations, None without a closed form. The second includes each wall's covariance from
    its own rough echo, and the distortion of the pilot by that wall's heights. [m]
    """
    try:
        known = scenario_position_bound(scenario, user).deviation
    except NoBound:  # no noise, or the position is not determined
        return None, None
    covariance = {}
    for name, body in scenario.objects.items():
        if isinstance(body, Plate) and body.material != "absorber":
            try:
                covariance[name] = wall_covariance_bound(scenario, name)
            except NoBound:  # a smooth wall, or 3-D: no closed form
                return known, None
    try:
        told = scenario_position_bound(scenario, user, wall_covariance=covariance).deviation
        return known, float(np.hypot(told, _bent(scenario, user)))
    except NoBound:  # the walls are too uncertain, or the scene is 3-D
        return known, None


def _bent(scenario: Scenario, user: str) -> float:
    """Return the position error by a wall's heights in the pilot, if over that wall alone [m].

    With a direct path in addition, or over several walls, there is no closed form; then it is 0.
    """
    heard = user_waves(scenario, user)
    if len(heard.paths) != 1 or len(heard.paths[0]) != 1:
        return 0.0
    return roughness_floor(scenario, user, heard.owners[heard.paths[0][0]]).deviation
