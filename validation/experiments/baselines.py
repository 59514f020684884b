"""The methods of the thesis' introduction against ours: LoS, LoS and one wall, NLoS.

Run as ``python -m validation.experiments.baselines [--quick | --scales] [FILE.png]``; ``--scales``
prints what the weight of angles does to fingerprints, and nothing else. A trial of all methods
takes some 20 s on two idle cores: eighteen of them, and three with ``--quick``. The numbers
go to a CSV file beside the figure.

The thesis' introduction compares in words; here each method of :mod:`validation.baselines` gets the
same realisation of the same room; its docstring states its additional inputs and assumptions.
Chosen: ``los_user``, ``los_and_nlos_user`` and ``slam_2d`` unchanged, each with three users (two
of them moved, within the imaged region) and two realisations of roughness
and noise, 20 dB per channel sample at our array and its noise at every other receiver. *Ours* is
the whole estimator on our echo and pilot.

Claims that are asserted: ours is within 1 mm in sight and hidden alike, in the median, and never
wrong by more than 5 mm; hidden, every method without a map or a survey is wrong by decimetres or
has no answer, and the survey of fingerprints gives centimetres to decimetres; in sight, one array
and times of arrival are good to a millimetre as well, so that it is the hidden user that needs
what is new.
"""

import csv
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from estimator.localization.pipeline import locate
from scenes.files.loading import load_scenario
from simulator.simulation import simulate
from validation.baselines.angle_difference import angle_difference
from validation.baselines.fingerprinting import fingerprinting, fixes_by_weight
from validation.baselines.multiband_toa import multiband_toa
from validation.baselines.room import Baseline, Room
from validation.baselines.rssi_ranging import rssi_ranging
from validation.baselines.scatterer_paths import scatterer_paths
from validation.baselines.single_array import single_array
from validation.baselines.steered_ranging import steered_ranging
from validation.baselines.tdoa import tdoa
from validation.baselines.toa_trilateration import toa_trilateration
from validation.metrics.errors import ErrorSummary, error_summary

OURS = "ours"
METHODS: dict[str, Baseline] = {
    "RSSI ranging": rssi_ranging,
    "ToA, 4 anchors": toa_trilateration,
    "TDoA, 4 receivers": tdoa,
    "RSSI/AoA fingerprints": fingerprinting,
    "ADoA, 4 access points": angle_difference,
    "multi-band ToA": multiband_toa,
    "low band steers ranging": steered_ranging,
    "AoA+AoD+ToA, scatterers": scatterer_paths,
    "AoA+ToA, no map": single_array,
}
SIGHT, BOTH, HIDDEN = "in sight", "in sight and over the wall", "over the wall only"
CASES: dict[str, tuple[str, tuple[tuple[float, float], ...]]] = {
    SIGHT: ("los_user", ((0.20, 0.40), (0.22, 0.42), (0.15, 0.45))),
    BOTH: ("los_and_nlos_user", ((0.50, 0.75), (0.45, 0.70), (0.55, 0.80))),
    HIDDEN: ("slam_2d", ((1.00, 0.80), (0.80, 0.80), (1.10, 0.85))),
}
"""Scenario, and positions of the user [m]."""

EXACT_IN_SIGHT = ("ToA, 4 anchors", "AoA+ToA, no map")
"""Methods without errors of their model in line of sight."""

SURVEYED = ("RSSI/AoA fingerprints",)
POSITIONS, SEEDS = 3, 2
TRIALS = len(CASES) * POSITIONS * SEEDS * (len(METHODS) + 1)
MILLIMETRE, MOST = 1e-3, 5e-3
DECIMETRES = 0.1
"""Least error of all methods without a map in NLoS: the user's image is as far behind the wall as
the user is in front of it. [m]"""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One method's result for one realisation."""

    case: str
    method: str
    x: float  # of the user [m]
    y: float
    seed: int
    error: float | None  # None: no position [m]
    reason: str | None  # why there is no position
    duration: float  # [s]


def baselines(
    *, positions: int = POSITIONS, seeds: int = SEEDS, methods: Sequence[str] = (*METHODS, OURS)
) -> Iterator[Trial]:
    """Run the methods on all cases, ours last in each room.

    Parameters
    ----------
    positions, seeds
        Numbers of each case's users, and of realisations of each.
    methods
        Names of the methods.
    """
    for case, (name, places) in CASES.items():
        for x, y in places[:positions]:
            scenario = load_scenario(name, (f"users.user.position_m=[{x}, {y}]",))
            for seed in range(seeds):
                room = Room(scenario, seed=seed)
                for method in methods:
                    started = time.perf_counter()
                    if method == OURS:
                        (user,) = locate(simulate(scenario, seed=seed).measurement).users
                        found = None if user.position is None else user.position[:2]
                        reason = user.reason
                        if user.status != "found":
                            found = None
                    else:
                        fix = METHODS[method](room)
                        found, reason = fix.position, fix.reason
                    error = None if found is None else float(np.hypot(*(found - (x, y))))
                    yield Trial(
                        case=case,
                        method=method,
                        x=x,
                        y=y,
                        seed=seed,
                        error=error,
                        reason=reason,
                        duration=time.perf_counter() - started,
                    )


def summaries(trials: Sequence[Trial]) -> dict[tuple[str, str], ErrorSummary]:
    """Summarise the errors of each method in each case."""
    groups: dict[tuple[str, str], list[float | None]] = {}
    for trial in trials:
        groups.setdefault((trial.method, trial.case), []).append(trial.error)
    return {key: error_summary(errors) for key, errors in groups.items()}


def check(trials: Sequence[Trial]) -> list[str]:
    """Check the claims; return the table's lines.

    Raises
    ------
    RuntimeError
        If a claim does not hold.
    """
    found = summaries(trials)
    methods = list(dict.fromkeys(trial.method for trial in trials))
    told = ["method | " + " | ".join(f"{case}: median, worst [mm]" for case in CASES)]
    for method in methods:
        cells = [_cell(found.get((method, case))) for case in CASES]
        told.append(f"{method} | " + " | ".join(cells))
    wrong = []
    for (method, case), summary in found.items():
        claim = None
        if method == OURS:
            if not (summary.median < MILLIMETRE and summary.worst < MOST):
                claim = "a median below 1 mm, and all below 5 mm"
        elif case == HIDDEN:
            least = float(summary.errors[0]) if summary.errors.size else float("inf")
            if method in SURVEYED:
                if not 10 * MILLIMETRE < summary.median < 3 * DECIMETRES:
                    claim = "centimetres to decimetres"
            elif not least > DECIMETRES:
                claim = "decimetres at least, or no answer"
        elif case == SIGHT and method in EXACT_IN_SIGHT:
            if not summary.worst < MILLIMETRE:
                claim = "less than a millimetre"
        if claim:
            wrong.append(f"{method}, {case}: {_cell(summary)} mm; {claim} is claimed")
    if wrong:
        raise RuntimeError("\n".join([*told, *wrong]))
    return told


def _cell(summary: ErrorSummary | None) -> str:
    if summary is None:
        return "-"
    if not summary.errors.size:
        return "no answer"
    text = f"{1e3 * float(np.median(summary.errors)):.3g}, {1e3 * float(summary.errors[-1]):.3g}"
    answered = len(summary.errors)
    return text if not summary.missing else f"{text} ({answered} of {summary.trials} answered)"


def draw(ax: Axes, trials: Sequence[Trial], case: str) -> Axes:
    """Draw the errors of all methods in one case, on a logarithmic axis; no position at its end."""
    methods = list(dict.fromkeys(trial.method for trial in trials))
    end = 1e4
    for row, method in enumerate(reversed(methods)):
        chosen = [trial for trial in trials if (trial.method, trial.case) == (method, case)]
        errors = [1e3 * trial.error for trial in chosen if trial.error is not None]
        colour = "#d1495b" if method == OURS else "#30638e"
        ax.plot(errors, [row] * len(errors), "o", color=colour, alpha=0.6)
        if errors:
            ax.plot([float(np.median(errors))], [row], "|", color=colour, ms=18, mew=2.5)
        missing = len(chosen) - len(errors)
        if missing:
            ax.text(end, row, f"no answer: {missing}", ha="right", va="center", fontsize=8)
    ax.set(
        xscale="log",
        xlim=(1e-4, end),
        xlabel="position error [mm]",
        title=case,
        yticks=range(len(methods)),
        yticklabels=methods[::-1],
        ylim=(-0.6, len(methods) - 0.4),
    )
    ax.axvline(1.0, color="0.7", lw=0.8)
    ax.grid(alpha=0.25, axis="x")
    return ax


def write_numbers(path: Path, trials: Sequence[Trial]) -> None:
    """Write a line for each trial, lengths in metres."""
    names = list(Trial.__dataclass_fields__)
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(names)
        for trial in trials:
            rows.writerow([getattr(trial, name) for name in names])


def main(arguments: list[str]) -> None:
    """Run the methods, write numbers and figure, and check the claims."""
    if "--scales" in arguments:
        for case, (name, places) in CASES.items():
            position = f"users.user.position_m=[{places[0][0]}, {places[0][1]}]"
            fixes = fixes_by_weight(Room(load_scenario(name, (position,)), seed=0))
            errors = [1e3 * float(np.hypot(*(fix - places[0]))) for fix in fixes]
            print(f"{case}: " + ", ".join(f"{error:.0f} mm" for error in errors), flush=True)
        return
    quick = "--quick" in arguments
    names = [argument for argument in arguments if argument != "--quick"]
    path = Path(names[0] if names else "baselines.png")
    trials = []
    for trial in baselines(positions=1, seeds=1) if quick else baselines():
        trials.append(trial)
        answer = trial.reason if trial.error is None else f"{1e3 * trial.error:.4g} mm"
        place = f"({trial.x:g}, {trial.y:g}), seed {trial.seed}"
        print(
            f"{trial.case}, {place}, {trial.method}: {answer} ({trial.duration:.1f} s)", flush=True
        )
        write_numbers(path.with_suffix(".csv"), trials)
    figure, axes = plt.subplots(1, 3, figsize=(15, 5), layout="constrained", sharey=True)
    for ax, case in zip(axes, CASES, strict=True):
        draw(ax, trials, case)
    figure.savefig(path, dpi=130)
    print(f"written: {path}, {path.with_suffix('.csv')}")
    for line in check(trials):
        print(line)


if __name__ == "__main__":
    main(sys.argv[1:])
