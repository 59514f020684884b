"""Whole answers to simulated rooms against the truth, as one constant of the estimator changes.

The rooms are those of :mod:`validation.trials.trap_rooms`, which are small. Each group of constants
has its own ones, in which their decisions occur. For the search by diffuse scattering, which a
whole estimate seldom needs, it is run by itself, with the true wall.
"""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from unittest.mock import patch

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from estimator.geometry.wall_2d import Wall
from estimator.localization.pipeline import locate
from estimator.localization.stages import MappedRoom
from estimator.localization.stages_2d import LinearStages
from estimator.measurement.model import Echo, Measurement, Uplink
from estimator.positioning.diffuse_positioning import search_diffuse
from estimator.positioning.wall_anchors import SeenWall
from estimator.results.estimate import Mirror, Target, UserEstimate
from scenes.files.loading import load_scenario
from simulator.simulation import simulate
from validation.metrics.coverage import normalised_square, position_errors
from validation.metrics.mirror_check import seen_mirrors
from validation.metrics.target_association import target_distances
from validation.metrics.truth import Truth, truth_from_dataset
from validation.trials.trap_rooms import HALF_SIZE, TRAPS
from validation.trials.trap_rooms import user as user_at

REGION = float(chi2.ppf(0.999, 2))
"""Normalised square of an error beyond which a position that is called found is wrong. [-]"""
AT_SOMETHING = 0.02
"""Distance from every wall and body above which a target is false: three cells λ/2D at 0.8 m.
[m]"""

WALLS_IN_WALLS = ("corner, in sight", "parallel, over both", "short second wall, 14 cm")
"""Rooms whose walls are seen over each other."""
BODIES = ("post before the wall", "post beside a sight line", "convex mirror", "corner, in sight")
"""Rooms with posts, a column, and the ends of walls."""
PATHS = (
    "plain",
    "in sight and over it",
    "convex mirror",
    "unknown clock, two paths",
    "smooth wall, its ends in sight",
    "behind, past an end",
    "post before the wall",
)
"""Rooms whose pilots come over a wall, in line of sight, and from edges and curved bodies."""
DIFFUSE = tuple((angle, rms) for angle in (25.0, 35.0, 45.0, 60.0) for rms in (0.05, 0.15))
"""Angle [°] and rms height [mm] of walls for diffuse scattering; only at 45° is there a path."""
DIFFUSE_SEEDS = 2
"""Realisations of each of these walls. [-]"""


@dataclass(frozen=True, kw_only=True)
class SimulatedRoom:
    """One realisation of a room, with its truth."""

    measurement: Measurement
    truth: Truth


@dataclass(frozen=True, kw_only=True)
class Answers:
    """Counts of right and wrong answers to several rooms of one user each."""

    right: int  # users found whose region holds the truth
    wrong: int  # users found whose region does not
    median_error: float  # of users found; NaN without any [m]
    walls: int  # true walls on which a mirror was reported
    false_walls: int  # mirrors reported on no wall
    targets: int  # reported
    false_targets: int  # reported where nothing is
    told: tuple[str, ...] = field(
        default=(), repr=False
    )  # everything that was answered, for each room

    @property
    def merit(self) -> int:
        """Right answers less wrong ones; targets count by false ones only. [-]."""
        return self.right - self.wrong + self.walls - self.false_walls - self.false_targets


def simulated_room(name: str, seed: int) -> SimulatedRoom:
    """Simulate one realisation of a trap room."""
    scenario, overrides = TRAPS[name]
    simulation = simulate(load_scenario(scenario, overrides), seed=seed)
    return SimulatedRoom(
        measurement=simulation.measurement, truth=truth_from_dataset(simulation.truth)
    )


@contextmanager
def each_mapped_once() -> Iterator[None]:
    """Keep the map of each linear array's echo, for constants that do not change it."""
    mapped = LinearStages.map_room
    maps: dict[bytes, MappedRoom] = {}

    def once(stages: LinearStages, echo: Echo) -> MappedRoom:
        key = echo.samples.tobytes()
        if key not in maps:
            maps[key] = mapped(stages, echo)
        return maps[key]

    with patch.object(LinearStages, "map_room", once):
        yield


def answers(rooms: Sequence[SimulatedRoom]) -> Answers:
    """Locate the users of rooms, and count what is right and what is wrong."""
    errors: list[float] = []
    told = []
    right = wrong = walls = false_walls = targets = false_targets = 0
    for room in rooms:
        estimate = locate(room.measurement, images=False)
        told.append(told_by(estimate.users, estimate.mirrors, estimate.targets))
        (user,) = estimate.users
        error, square = position_errors(user, room.truth.user_position[user.name])
        if user.status == "found" and error is not None:
            errors.append(error)
            inside = square is not None and square < REGION
            right, wrong = right + inside, wrong + (not inside)
        mirrors = seen_mirrors(estimate, room.truth)
        walls += len({one.wall for one in mirrors} - {None})
        false_walls += sum(one.wall is None for one in mirrors)
        targets += len(estimate.targets)
        away = target_distances(estimate.targets, room.truth)[0]
        false_targets += int(np.sum(away > AT_SOMETHING))
    return Answers(
        right=right,
        wrong=wrong,
        median_error=float(np.median(errors)) if errors else np.nan,
        walls=walls,
        false_walls=false_walls,
        targets=targets,
        false_targets=false_targets,
        told=tuple(told),
    )


def told_by(
    users: Sequence[UserEstimate], mirrors: Sequence[Mirror], targets: Sequence[Target] = ()
) -> str:
    """Write users, mirrors and targets out in full, so that answers differ if anything does."""
    answered: list[UserEstimate | Mirror | Target] = [*users, *mirrors, *targets]
    parts = [asdict(one) for one in answered]
    with np.printoptions(precision=17, threshold=sys.maxsize):
        return repr(parts)


@dataclass(frozen=True, kw_only=True)
class RoughPilot:
    """A pilot over one rough wall, and the true wall and position."""

    uplink: Uplink
    wall: Wall  # without uncertainty
    position: Float[np.ndarray, " 3"]  # [m]


def rough_pilot(angle_deg: float, rms_mm: float, seed: int) -> RoughPilot:
    """Simulate the pilot of a user over one rough wall, at half the size of ``slam_2d``."""
    overrides = [
        *HALF_SIZE,
        *user_at(0.45, 0.4),
        f"objects.wall.angle_deg={angle_deg}",
        f"objects.wall.roughness.rms_mm={rms_mm}",
        "objects.wall.roughness.correlation_mm=0.5",
    ]
    simulation = simulate(load_scenario("slam_2d", overrides), seed=seed)
    truth = truth_from_dataset(simulation.truth)
    start, end = truth.wall_start["wall"], truth.wall_end["wall"]
    return RoughPilot(
        uplink=simulation.measurement.uplinks[0],
        wall=Wall(start=start, end=end, covariance=np.zeros((2, 2))),
        position=truth.user_position["user"],
    )


def diffuse_answers(pilots: Sequence[RoughPilot]) -> Answers:
    """Search users by diffuse scattering alone; found are those without rival positions."""
    errors: list[float] = []
    told = []
    right = 0
    for one in pilots:
        fix = search_diffuse(one.uplink, [SeenWall(seen=one.wall, true=one.wall, through=())])
        told.append("" if fix is None else repr([fix.position.tolist(), fix.rivals.tolist()]))
        if fix is None or len(fix.rivals):
            continue
        error = (fix.position - one.position)[:2]
        errors.append(float(np.linalg.norm(error)))
        right += normalised_square(error, fix.covariance[:2, :2]) < REGION
    return Answers(
        right=right,
        wrong=len(errors) - right,
        median_error=float(np.median(errors)) if errors else np.nan,
        walls=0,
        false_walls=0,
        targets=0,
        false_targets=0,
        told=tuple(told),
    )
