"""Data that contradict themselves, and what each gives.

Run as ``python -m validation.trials.contradictions [SEEDS [NAME …]]``.

Not in the thesis. A delay, a scale, a sign, gains, dead or hot positions, a pilot that nobody
sends: each fault of :mod:`validation.trials.contradictory_data` is put into clean measurements of
three scenes, in sizes from none to large. What must not happen is an answer that is called
``found`` with the truth outside its 99.9 % region (χ² with two degrees of freedom). What the data
cannot tell is listed in ``docs/measured_data.md``; :data:`UNSEEN` names those rows.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from estimator.localization.pipeline import locate
from estimator.measurement.model import Measurement, MeasurementError
from scenes.files.loading import load_scenario
from simulator.simulation import Simulation, simulate
from validation.metrics.coverage import position_errors
from validation.metrics.truth import truth_from_dataset
from validation.trials.contradictory_data import BESIDE, CONTRADICTIONS, SCENES

REGION = float(chi2.ppf(0.999, 2))
"""Normalised square of an error beyond which an answer that is called found is wrong. [-]"""

FAULTS = (ArithmeticError, IndexError, np.linalg.LinAlgError, TypeError, ValueError)
"""What a fault of the program raises; told in the table, and counted as wrong."""

UNSEEN: frozenset[tuple[str, str, str]] = frozenset(
    {
        ("over a wall", "echo delayed", "0.003 ns"),
        ("posts", "echo delayed", "0.003 ns"),
        ("over a wall", "pilot delayed", "0.003 ns"),
        ("over a wall", "pilot delayed", "0.03 ns"),
        ("over a wall", "pilot delayed", "0.1 ns"),
    }
)
"""Scene, contradiction and size that the data do not show: half a millimetre of an echo whose focus
tells 1 mm, and 1 to 30 mm of a pilot over a rough wall whose curvature tells 20 mm."""


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What one contradiction gave in one scene."""

    scene: str
    contradiction: str
    size: str
    status: str
    error: float | None  # [m]
    square: float | None  # of the error over its covariance [-]
    told: tuple[str, ...]  # the reason, and notes
    duration: float  # [s]

    @property
    def wrong(self) -> bool:
        """Whether something was called found that is not there, or the program failed."""
        if self.status == "TRACEBACK":
            return True
        return self.status == "found" and (self.square is None or not self.square < REGION)


def answered(
    measurement: Measurement, truth: np.ndarray, *, scene: str, contradiction: str, size: str
) -> Answer:
    """Locate and compare."""
    started = time.perf_counter()
    try:
        estimate = locate(measurement, images=False)
    except (MeasurementError, *FAULTS) as raised:
        status = "refused" if isinstance(raised, MeasurementError) else "TRACEBACK"
        return Answer(
            scene=scene, contradiction=contradiction, size=size, status=status, error=None,
            square=None, told=(str(raised),), duration=time.perf_counter() - started,
        )  # fmt: skip
    (only,) = estimate.users
    error, square = position_errors(only, truth)
    nobody = contradiction == "nobody sends"
    return Answer(
        scene=scene,
        contradiction=contradiction,
        size=size,
        status=only.status,
        error=error,
        square=np.inf if nobody and only.status == "found" else square,
        told=(*([only.reason] if only.reason else []), *estimate.notes),
        duration=time.perf_counter() - started,
    )


def answers(seeds: int, names: list[str]) -> Iterator[Answer]:
    """Try the named contradictions, all if none is named, in all scenes."""
    for seed in range(seeds):
        for scene, (scenario, overrides) in SCENES.items():
            clean = simulate(load_scenario(scenario, overrides), seed=seed)
            truth = truth_from_dataset(clean.truth).user_position["user"]
            for name, one in CONTRADICTIONS.items():
                if names and name not in names:
                    continue
                for size in one.sizes:
                    rng = np.random.default_rng([seed, sum(name.encode()), round(1e3 * size)])
                    data = one.fault(clean.measurement, size, rng)
                    yield answered(
                        data, truth, scene=scene, contradiction=name, size=f"{size:g} {one.unit}"
                    )
            for name, moved in BESIDE.items():
                if names and name not in names:
                    continue
                elsewhere = simulate(load_scenario(scenario, (*overrides, *moved)), seed=seed)
                yield answered(
                    _with_pilot(clean, elsewhere), truth, scene=scene, contradiction=name, size=""
                )


def _with_pilot(echo: Simulation, pilot: Simulation) -> Measurement:
    """Join the echo of one simulation with the pilot of another."""
    return replace(echo.measurement, uplinks=pilot.measurement.uplinks)


def row(one: Answer) -> str:
    """Describe one answer in a line."""
    answer = one.status
    if one.error is not None and one.square is not None:
        answer += f" {1e3 * one.error:.3g} mm, e'C⁻¹e {one.square:.3g}"
    unseen = (one.scene, one.contradiction, one.size) in UNSEEN
    verdict = "fair" if not one.wrong else "unseen" if unseen else "WRONG"
    return (
        f"{one.contradiction:32s} {one.size:12s} {one.scene:12s} | {answer:45s} | "
        f"{verdict:6s} | {one.duration:.1f} s"
    )


def main(arguments: list[str]) -> int:
    """Print a table; return 1 if something was said with confidence and is wrong."""
    seeds = int(arguments[0]) if arguments else 1
    wrong = 0
    for one in answers(seeds, arguments[1:]):
        wrong += one.wrong and (one.scene, one.contradiction, one.size) not in UNSEEN
        print(row(one), flush=True)
        for text in one.told:
            print(f"{'':8s}{text}", flush=True)
    print(f"confidently wrong: {wrong}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
