"""The thesis' first open problem: a user over a wall whose diffuse scattering dominates.

Run as ``python -m validation.experiments.diffuse_search [FILE.png] [SEEDS]``; four minutes a seed
on two cores.

``slam_2d`` with walls from smooth to far rougher than the wavelength allows a mirror to be
(correlation length 0.5 mm), at 45°, where the user has a mirror-like path, and at 35°, where it
has none. Drawn for each: the error of the whole estimator's answer, by what it rests on, and that
of the search by diffuse scattering alone, over the walls that the estimator found.

Claims that are asserted:

- If the whole wall scatters diffusely (0.05 mm rms and more), the diffuse search finds the user
  within 10 mm, with or without a path over the mirror: its range cell is 4 mm, and over a wall of
  0.4 m, 1 m away, an error of distance is magnified 7 times across.
- On walls too smooth to scatter enough (below 0.01 mm rms with a path, which then locates the user
  by itself) it returns no position, not a wrong one.
- No position with the status found has the truth outside its 99.9 % region.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from scipy.stats import chi2

from estimator.geometry.wall_2d import Wall
from estimator.localization.pipeline import locate
from estimator.measurement.model import Uplink
from estimator.positioning.diffuse_positioning import search_diffuse
from estimator.positioning.wall_anchors import SeenWall
from estimator.results.estimate import Estimate, UserEstimate
from scenes.files.loading import load_scenario
from simulator.simulation import simulate

ANGLES_DEG = (45.0, 35.0)
RMS_MM = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4)
CORRELATION_MM = 0.5
ROUGH_MM = 0.05
"""Least rms height at which diffuse scattering comes from the whole wall. [mm]"""
LARGEST_ERROR = 10e-3
"""Largest error of the diffuse search over a rough wall. [m]"""
CONFIDENT = float(chi2.ppf(0.999, df=2))


@dataclass(frozen=True, kw_only=True)
class Trial:
    """Result of one realisation of one room."""

    angle_deg: float
    rms_mm: float
    seed: int
    status: str
    method: str
    error: float | None  # of the estimated position [m]
    squared: float | None  # normalised square of that error [-]
    diffuse_error: float | None  # of the diffuse search alone; None: no answer [m]


def run_trial(angle_deg: float, rms_mm: float, seed: int) -> Trial:
    """Simulate and locate once."""
    scenario = load_scenario(
        "slam_2d",
        [
            f"objects.wall.angle_deg={angle_deg}",
            f"objects.wall.roughness.rms_mm={rms_mm}",
            f"objects.wall.roughness.correlation_mm={CORRELATION_MM}",
        ],
    )
    measurement = simulate(scenario, seed=seed).measurement
    truth = scenario.users["user"].position
    estimate = locate(measurement)
    answer = estimate.users[0]
    diffuse = _diffuse_alone(measurement.uplinks[0], estimate)
    return Trial(
        angle_deg=angle_deg,
        rms_mm=rms_mm,
        seed=seed,
        status=answer.status,
        method=answer.method,
        error=None if answer.position is None else _length(answer.position - truth),
        squared=_squared(answer, truth),
        diffuse_error=None if diffuse is None else _length(diffuse - truth),
    )


def _diffuse_alone(uplink: Uplink, estimate: Estimate) -> np.ndarray | None:
    walls = [
        SeenWall(seen=wall, true=wall, through=())
        for mirror in estimate.mirrors
        if not mirror.seen_through
        for wall in [Wall(start=mirror.start, end=mirror.end, covariance=mirror.covariance)]
    ]
    fix = search_diffuse(uplink, walls)
    return None if fix is None or len(fix.rivals) else fix.position


def _length(vector: np.ndarray) -> float:
    return float(np.linalg.norm(vector))


def _squared(answer: UserEstimate, truth: np.ndarray) -> float | None:
    if answer.position is None or answer.covariance is None:
        return None
    apart = (answer.position - truth)[:2]
    return float(apart @ np.linalg.solve(answer.covariance[:2, :2], apart))


def draw(ax: Axes, trials: list[Trial], angle_deg: float) -> Axes:
    """Draw the errors of one wall angle over its roughness."""
    here = [trial for trial in trials if trial.angle_deg == angle_deg]
    styles = {
        ("found", "paths"): ("o", "tab:blue", "found over mirror-like paths"),
        ("found", "diffuse"): ("s", "tab:green", "found by diffuse scattering"),
        ("ambiguous", "paths"): ("^", "tab:orange", "ambiguous"),
        ("ambiguous", "diffuse"): ("^", "tab:orange", "ambiguous"),
    }
    told = set()
    for trial in here:
        style = styles.get((trial.status, trial.method))
        if style is None or trial.error is None:
            continue
        marker, colour, label = style
        ax.plot(
            trial.rms_mm,
            1e3 * trial.error,
            marker,
            color=colour,
            label=None if label in told else label,
        )
        told.add(label)
    missed = [trial.rms_mm for trial in here if trial.status == "not_found"]
    ax.plot(missed, np.full(len(missed), 0.02), "x", color="black", label="not found")
    alone = [(t.rms_mm, 1e3 * t.diffuse_error) for t in here if t.diffuse_error is not None]
    if alone:
        ax.plot(*zip(*alone, strict=True), "+", color="tab:green", label="diffuse search alone")
    ax.set(
        xscale="log",
        yscale="log",
        ylim=(0.01, 1000),
        xlabel="rms roughness of the wall [mm]",
        ylabel="position error [mm]",
        title=f"wall at {angle_deg:g}°: "
        + ("a mirror-like path" if angle_deg == ANGLES_DEG[0] else "no mirror-like path"),
    )
    ax.grid(visible=True, which="both", alpha=0.2)
    ax.legend(fontsize="small")
    return ax


def main(picture: Path, seeds: int) -> None:
    """Run all trials, write the table and the figure, and assert the claims."""
    trials = []
    for angle_deg in ANGLES_DEG:
        for rms_mm in RMS_MM:
            for seed in range(seeds):
                trial = run_trial(angle_deg, rms_mm, seed)
                trials.append(trial)
                print(
                    f"{angle_deg:g}° {rms_mm:5.3f} mm seed {seed}: {trial.status:9s} "
                    f"{trial.method:7s} {_mm(trial.error)} mm, diffuse alone "
                    f"{_mm(trial.diffuse_error)} mm",
                    flush=True,
                )
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for ax, angle_deg in zip(axes, ANGLES_DEG, strict=True):
        draw(ax, trials, angle_deg)
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=130)
    plt.close(figure)
    for trial in trials:
        if trial.rms_mm >= ROUGH_MM:
            assert trial.diffuse_error is not None, trial
            assert trial.diffuse_error < LARGEST_ERROR, trial
        if trial.status == "found":
            assert trial.squared is not None, trial
            assert trial.squared < CONFIDENT, trial


def _mm(length: float | None) -> str:
    return "   none" if length is None else f"{1e3 * length:7.3f}"


if __name__ == "__main__":
    main(
        Path(sys.argv[1] if len(sys.argv) > 1 else "out/diffuse_search.png"),
        int(sys.argv[2]) if len(sys.argv) > 2 else 2,
    )
