"""Rooms that invite a confident wrong answer, and what each gives.

Run as ``python -m validation.experiments.traps [SEEDS [TRAP …]]``.

Not in the thesis, which knows its one wall beforehand. Each trap is a room in two dimensions
with walls and users where a careless estimator folds a path that is direct, takes a wall for
another, a ghost for a wall, an edge for a user, or a bent wave for a mirror's. Scenes of half
the library's size keep a trial short: 128 elements, 251 frequencies (501 where something stands
farther away than 0.5 m of echo or 1 m of path are unambiguous), walls 0.4 m away.

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
from jaxtyping import Float
from scipy.stats import chi2, norm

from estimator.estimate import Estimate, Mirror, UserEstimate
from estimator.localization import locate
from scenes.library import load_scenario
from simulator.simulation import simulate
from validation.calibration import normalised_square
from validation.metrics import distances_from_segment, nearest_wall, wall_error
from validation.truth import Truth, truth_from_dataset

SEEDS = 3
REGION = float(chi2.ppf(0.999, 2))
"""Normalised square of an error beyond which an answer that is called found is wrong. [-]"""
CONFIDENT = 0.99
"""Confidence of a mirror above which it must not be false. [-]"""
ON_WALL = 0.01
"""Distance from a wall within which a place is on it: a cell λ/2D at 1 m. [m]"""
SHARE_ON_WALL = 0.8
"""Share of a mirror that must be on true walls: its ends are known to some cells only. [-]"""
TURNED = np.radians(1.0)
"""Angle from a wall beyond which a mirror may be false: at 0.5 m it moves a user by 2 cm. [rad]"""
DEVIATIONS = float(norm.isf(0.0005))
"""Deviations of its angle that a mirror must be turned by as well: outside its 99.9 % interval. A
wall of some 20 cells, such as the one of 7 cm, is known to 1° only, and says so. [-]"""

HALF_SIZE = (
    "base_station.elements=128",
    "radio.points=251",
    "objects.wall.centre_m=[0.0, 0.4]",
    "objects.wall.length_m=0.2",
)
FARTHER = (*HALF_SIZE, "radio.points=501")
COARSER = ("objects.wall.roughness.rms_mm=0.1", "objects.wall.roughness.correlation_mm=0.6")
FACING = (*FARTHER, *COARSER)
"""Where walls see each other: coarser facets, whose pairs are a quarter as many."""


def plate(
    name: str, x: float, y: float, angle: float, length: float, *, coarser: bool = False
) -> tuple[str, ...]:
    """Return the overrides that add a metal plate, as rough as the first wall."""
    key = f"objects.{name}"
    return (
        f"{key}.kind=plate",
        f"{key}.material=metal",
        f"{key}.centre_m=[{x}, {y}]",
        f"{key}.angle_deg={angle}",
        f"{key}.length_m={length}",
        f"{key}.roughness.rms_mm={0.1 if coarser else 0.05}",
        f"{key}.roughness.correlation_mm={0.6 if coarser else 0.3}",
        f"{key}.roughness.spectrum=gaussian",
    )


def screen(x: float, y: float, angle: float, length: float) -> tuple[str, ...]:
    """Return the overrides that add an absorber."""
    return (
        "objects.screen.kind=plate",
        "objects.screen.material=absorber",
        f"objects.screen.centre_m=[{x}, {y}]",
        f"objects.screen.angle_deg={angle}",
        f"objects.screen.length_m={length}",
    )


def wall(x: float, y: float, angle: float, length: float) -> tuple[str, ...]:
    """Return the overrides that put the first wall elsewhere."""
    return (
        f"objects.wall.centre_m=[{x}, {y}]",
        f"objects.wall.angle_deg={angle}",
        f"objects.wall.length_m={length}",
    )


def post(name: str, x: float, y: float, radius: float) -> tuple[str, ...]:
    """Return the overrides that add a metal post."""
    key = f"objects.{name}"
    return (
        f"{key}.kind=cylinder",
        f"{key}.material=metal",
        f"{key}.centre_m=[{x}, {y}]",
        f"{key}.radius_m={radius}",
    )


def user(x: float, y: float, aim: str | None = None) -> tuple[str, ...]:
    """Return the overrides that put the user somewhere, and aim its beam if it has one."""
    place = (f"users.user.position_m=[{x}, {y}]",)
    return place if aim is None else (*place, f"users.user.antenna.aim={aim}")


BEAM, OPEN = "slam_2d", "los_user"
"""The user of the first sends a narrow beam, that of the second sends everywhere."""

TRAPS: dict[str, tuple[str, tuple[str, ...]]] = {
    "plain": (BEAM, (*HALF_SIZE, *user(0.45, 0.4))),
    # Two parallel walls
    "parallel, over both": (
        BEAM,
        (*FACING, *plate("second", 0.3, 0.4, 45.0, 0.2, coarser=True), *user(0.3, 0.65, "second")),
    ),
    "parallel, a corridor": (
        OPEN,
        (*FACING, *wall(-0.3, 0.3, 90.0, 0.4), *plate("second", 0.3, 0.3, 90.0, 0.4, coarser=True),
         *user(0.1, 0.6)),
    ),
    # A corner
    "corner, in sight": (
        OPEN,
        (*FACING, *wall(0.07, 0.47, 45.0, 0.19),
         *plate("second", 0.21, 0.47, -45.0, 0.19, coarser=True), *user(0.2, 0.22)),
    ),
    "corner, over two walls": (
        BEAM,
        (*FACING, *wall(0.07, 0.47, 45.0, 0.19),
         *plate("second", 0.21, 0.47, -45.0, 0.19, coarser=True), *user(0.22, 0.15, "second")),
    ),
    # A mirror seen edge-on
    "edge-on, before the array": (
        OPEN,
        (*HALF_SIZE, *wall(0.0, 0.3, 90.0, 0.15), *user(0.15, 0.35)),
    ),
    "edge-on, at the side": (
        OPEN,
        (*HALF_SIZE, *wall(0.18, 0.27, 56.3, 0.15), *user(0.09, 0.4)),
    ),
    "edge-on, hides the user": (
        BEAM,
        (*HALF_SIZE, *wall(0.05, 0.3, 85.0, 0.15), *user(0.1, 0.6, "wall")),
    ),
    # Two walls that both could explain the path
    "two staggered walls": (
        BEAM,
        (*HALF_SIZE, *wall(-0.05, 0.35, 45.0, 0.14), *plate("second", 0.05, 0.46, 45.0, 0.14),
         "users.user.antenna.sigma_rad=0.2", *user(0.45, 0.4)),
    ),
    "two walls, a bend": (
        BEAM,
        (*HALF_SIZE, *wall(-0.05, 0.35, 45.0, 0.14), *plate("second", 0.05, 0.455, 50.0, 0.14),
         "users.user.antenna.sigma_rad=0.2", *user(0.45, 0.4)),
    ),
    "two walls, both sides": (
        OPEN,
        (*HALF_SIZE, *COARSER, *wall(-0.2, 0.3, 70.0, 0.2),
         *plate("second", 0.2, 0.3, -70.0, 0.2, coarser=True), *screen(0.02, 0.2, 0.0, 0.08),
         *user(0.03, 0.3)),
    ),
    # A user behind the mirror, and beside it
    "behind, over a wall too far": (
        BEAM,
        (*HALF_SIZE, *COARSER, *plate("second", 0.3, 0.3, 90.0, 0.2, coarser=True),
         *user(0.05, 0.55, "second")),
    ),
    "behind, over a wall in sight": (
        BEAM,
        (*FACING, *plate("second", 0.22, 0.38, 90.0, 0.16, coarser=True),
         *user(-0.02, 0.8, "second")),
    ),
    "behind, over a wall too far aside": (
        BEAM,
        (*FACING, *plate("second", 0.3, 0.3, 90.0, 0.2, coarser=True),
         *user(0.05, 0.55, "second")),
    ),
    "behind, past an end": (OPEN, (*FARTHER, *user(0.14, 0.5))),
    "behind": (OPEN, (*HALF_SIZE, *user(-0.05, 0.5))),
    "in sight beside it": (OPEN, (*HALF_SIZE, *user(0.1, 0.2))),
    "in sight and over it": (OPEN, (*HALF_SIZE, *user(0.25, 0.37))),
    # A bright post before the wall
    "post before the wall": (BEAM, (*HALF_SIZE, *post("post", 0.04, 0.3, 0.005), *user(0.45, 0.4))),
    "post in the ray": (BEAM, (*HALF_SIZE, *post("post", 0.0, 0.3, 0.005), *user(0.45, 0.4))),
    "post beside a sight line": (
        OPEN,
        (*HALF_SIZE, *post("post", 0.03, 0.12, 0.005), *user(0.1, 0.25)),
    ),
    "convex mirror": (
        BEAM,
        (*HALF_SIZE, *COARSER, *wall(-0.2, 0.25, 60.0, 0.1), *post("column", 0.07, 0.45, 0.1),
         *user(0.4, 0.38, "column")),
    ),
    # A wall with a doorway
    "doorway, through it": (
        OPEN,
        (*FARTHER, *wall(-0.08, 0.32, 45.0, 0.14), *plate("second", 0.08, 0.48, 45.0, 0.14),
         *user(0.0, 0.7)),
    ),
    "doorway, beside it": (
        BEAM,
        (*FARTHER, *wall(-0.08, 0.32, 45.0, 0.14), *plate("second", 0.08, 0.48, 45.0, 0.14),
         *user(0.428, 0.2, "wall")),
    ),
    "narrow doorway, through it": (
        OPEN,
        (*FARTHER, *wall(-0.065, 0.335, 45.0, 0.14), *plate("second", 0.065, 0.465, 45.0, 0.14),
         *user(0.0, 0.7)),
    ),
    "narrow doorway, beside it": (
        BEAM,
        (*FARTHER, *wall(-0.065, 0.335, 45.0, 0.14), *plate("second", 0.065, 0.465, 45.0, 0.14),
         *user(0.428, 0.22, "wall")),
    ),
    "doorway, beyond what is unambiguous": (
        OPEN,
        (*HALF_SIZE, *wall(-0.08, 0.32, 45.0, 0.14), *plate("second", 0.08, 0.48, 45.0, 0.14),
         *user(0.0, 0.7)),
    ),
    # Walls that are hard to see
    "short second wall, 14 cm": (
        BEAM,
        (*FACING, *plate("second", 0.3, 0.4, -45.0, 0.14, coarser=True),
         *screen(0.16, 0.05, 90.0, 0.35),
         *user(0.3, 0.1, "second")),
    ),
    "short second wall, 7 cm": (
        BEAM,
        (*FACING, *plate("second", 0.3, 0.4, -45.0, 0.07, coarser=True),
         *screen(0.16, 0.05, 90.0, 0.35),
         *user(0.3, 0.1, "second")),
    ),
    "wall 3 cm before the array": (
        BEAM,
        (*HALF_SIZE, *wall(0.02, 0.09, 45.0, 0.12), *user(0.4, 0.09)),
    ),
    "facing wall 3 cm before it": (
        OPEN,
        (*HALF_SIZE, *wall(0.06, 0.03, 0.0, 0.06), *user(-0.1, 0.3)),
    ),
    "smooth wall": (BEAM, (*HALF_SIZE, "objects.wall.roughness.rms_mm=0.0", *user(0.45, 0.4))),
    "smooth wall, its ends in sight": (
        BEAM,
        (*FARTHER, "objects.wall.roughness.rms_mm=0.0", *user(0.45, 0.4)),
    ),
    "smooth wall, hardly rough": (
        BEAM,
        (*HALF_SIZE, "objects.wall.roughness.rms_mm=0.001", *user(0.45, 0.4)),
    ),
    # Paths and clocks
    "too long by 0.15 m": (BEAM, (*HALF_SIZE, *user(0.75, 0.4))),
    "too long by 0.45 m": (BEAM, (*HALF_SIZE, *user(1.05, 0.4))),
    "too long by twice": (BEAM, (*HALF_SIZE, *user(2.0, 0.4))),
    "unknown clock, one path": (
        BEAM,
        (*HALF_SIZE, "impairments.clock_offset_ns=0.3", "impairments.clock_known=false",
         *user(0.45, 0.4)),
    ),
    "unknown clock, one direct path": (
        OPEN,
        (*HALF_SIZE, "impairments.clock_offset_ns=0.3", "impairments.clock_known=false",
         *user(0.1, 0.2)),
    ),
    "unknown clock, two paths": (
        OPEN,
        (*HALF_SIZE, "impairments.clock_offset_ns=0.3", "impairments.clock_known=false",
         *user(0.25, 0.37)),
    ),
    # No mirror-like path
    "wall turned away": (
        BEAM,
        (*HALF_SIZE, "objects.wall.angle_deg=25.0", "objects.wall.roughness.rms_mm=0.15",
         *user(0.4, 0.4)),
    ),
    "wall turned far away": (
        BEAM,
        (*HALF_SIZE, "objects.wall.angle_deg=60.0", "objects.wall.roughness.rms_mm=0.15",
         *user(0.3, 0.2)),
    ),
}  # fmt: skip
"""Scenario and overrides of each trap."""


@dataclass(frozen=True, kw_only=True)
class SeenMirror:
    """A mirror that was reported, beside the truth."""

    wall: str | None  # the true wall it lies on; None: it is false
    angle: float  # from the true wall's [rad]
    offset: float  # of the true wall's centre from it [m]
    confidence: float


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What one realisation of a trap gave."""

    mirrors: tuple[SeenMirror, ...]
    missed: tuple[str, ...]  # true walls on which no mirror lies
    status: str
    method: str
    bounces: int | None
    reason: str | None
    error: float | None  # of the position [m]
    square: float | None  # of that error, over its covariance [-]
    duration: float  # [s]

    @property
    def wrong(self) -> tuple[str, ...]:
        """What was said with confidence and is not so."""
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
    error, square = errors(only, truth.user_position[only.name])
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


def errors(
    answer: UserEstimate, truth: Float[np.ndarray, " 3"]
) -> tuple[float | None, float | None]:
    """Return the error of a position [m] and its square over its covariance [-]."""
    if answer.position is None or answer.covariance is None:
        return None, None
    error = (answer.position - truth)[:2]
    square = normalised_square(error, answer.covariance[:2, :2])
    return float(np.linalg.norm(error)), square


def seen_mirrors(estimate: Estimate, truth: Truth) -> tuple[SeenMirror, ...]:
    """Compare all mirrors that were reported with the true walls."""
    return tuple(_seen(mirror, truth) for mirror in estimate.mirrors)


def _seen(mirror: Mirror, truth: Truth) -> SeenMirror:
    name = nearest_wall(mirror, truth)
    if name is None:
        return SeenMirror(wall=None, angle=np.nan, offset=np.nan, confidence=mirror.confidence)
    nearest = wall_error(mirror, name, truth.wall_start[name], truth.wall_end[name])
    places = np.linspace(mirror.start, mirror.end, 41)
    distances = [
        distances_from_segment(places, truth.wall_start[one], truth.wall_end[one])
        for one in truth.wall_start
    ]
    on_walls = np.mean(np.min(distances, axis=0) < ON_WALL)
    known_to = DEVIATIONS * float(np.sqrt(mirror.covariance[0, 0]))
    right = on_walls >= SHARE_ON_WALL and nearest.angle < max(TURNED, known_to)
    return SeenMirror(
        wall=name if right else None,
        angle=nearest.angle,
        offset=nearest.offset,
        confidence=mirror.confidence,
    )


def table_row(name: str, seed: int, result: Trial) -> str:
    """Describe one trial in a line."""
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
    """Print a table; return 1 if something was said with confidence and is wrong."""
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
