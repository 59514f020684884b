"""Rooms prone to confidently wrong answers, and the estimator's answers.

Run as ``python -m validation.experiments.traps [SEEDS [TRAP …]]``.

Not in the thesis, whose one wall is known beforehand. Each trap is a room in two dimensions with
walls and users in which an estimator may unfold a direct path, take a wall for another, a ghost for
a wall, an edge for a user, or a wave from a convex body for that of a plane mirror. The rooms are
those of :mod:`validation.trials.trap_rooms`.

Claims that are asserted, for every trap and seed: no answer that is called ``found`` has the
truth outside its 99.9 % region (χ² with two degrees of freedom), and no mirror that is reported
with a confidence above 0.99 is false. A mirror is false if a good part of it is on no wall, or
if it is turned away from the wall that it lies on, by more than its stated deviation allows.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from estimator.localization.pipeline import locate
from scenes.files.loading import load_scenario
from simulator.simulation import simulate
from validation.metrics.coverage import position_errors
from validation.metrics.mirror_check import SeenMirror, seen_mirrors
from validation.metrics.truth import truth_from_dataset
from validation.trials.trap_rooms import TRAPS

SEEDS = 3
REGION = float(chi2.ppf(0.999, 2))
"""Normalised square of an error above which a position with the status found is wrong. [-]"""
CONFIDENT = 0.99
"""Confidence of a mirror above which it must not be false. [-]"""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """Result of one realisation of a trap."""

    mirrors: tuple[SeenMirror, ...]
    missed: tuple[str, ...]  # true walls on which no mirror lies
    status: str
    method: str
    bounces: int | None
    reason: str | None
    error: float | None  # of the position [m]
    square: float | None  # normalised square of that error [-]
    duration: float  # [s]

    @property
    def wrong(self) -> tuple[str, ...]:
        """Confident statements that are false: of the position, of a mirror."""
        said = []
        if self.status == "found" and (self.square is None or not self.square < REGION):
            said.append("position")
        if any(one.wall is None and one.confidence > CONFIDENT for one in self.mirrors):
            said.append("mirror")
        return tuple(said)


def trial(scenario: str, overrides: Sequence[str], *, seed: int) -> Trial:
    """Simulate one realisation of a trap, locate its user and compare."""
    simulation = simulate(load_scenario(scenario, overrides), seed=seed)
    truth = truth_from_dataset(simulation.truth)
    started = time.perf_counter()
    estimate = locate(simulation.measurement)
    duration = time.perf_counter() - started
    mirrors = seen_mirrors(estimate, truth)
    covered = {one.wall for one in mirrors}
    (only,) = estimate.users
    error, square = position_errors(only, truth.user_position[only.name])
    return Trial(
        mirrors=mirrors,
        missed=tuple(name for name in truth.wall_start if name not in covered),
        status=only.status,
        method=only.method,
        bounces=only.bounces,
        reason=only.reason,
        error=error,
        square=square,
        duration=duration,
    )


def table_row(name: str, seed: int, result: Trial) -> str:
    """Return the line of one trial."""
    right = [
        f"{one.wall} {np.degrees(one.angle):.3f}°/{1e3 * one.offset:+.2f} mm"
        for one in result.mirrors
        if one.wall is not None
    ]
    false = [
        f"{np.degrees(one.angle):.2f}°/{1e3 * one.offset:+.1f} mm"
        for one in result.mirrors
        if one.wall is None
    ]
    mirrors = f"mirrors: {', '.join(right) or 'none'}"
    if false:
        mirrors += f"; FALSE {', '.join(false)}"
    if result.missed:
        mirrors += f"; missed {', '.join(result.missed)}"
    answer = result.status
    if result.error is not None and result.square is not None:
        answer += (
            f" ({result.method}, {result.bounces} bounces) error {1e3 * result.error:.3g} mm, "
            f"e'C⁻¹e {result.square:.3g}"
        )
    verdict = f"CONFIDENTLY WRONG: {' and '.join(result.wrong)}" if result.wrong else "fair"
    return f"{name:30s} {seed} | {mirrors} | {answer} | {verdict} | {result.duration:.1f} s"


def main(arguments: list[str]) -> int:
    """Print a table; return 1 if a confident statement is false."""
    seeds = int(arguments[0]) if arguments else SEEDS
    wrong = 0
    for name in arguments[1:] or TRAPS:
        for seed in range(seeds):
            result = trial(*TRAPS[name], seed=seed)
            wrong += bool(result.wrong)
            print(table_row(name, seed, result), flush=True)
            if result.reason:
                print(f"{'':32s} {result.reason}", flush=True)
    print(f"confidently wrong: {wrong}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
