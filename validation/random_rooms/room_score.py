"""How an answer to a random room compares with the truth and with what an oracle could answer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from estimator.results.estimate import Estimate, Target, UserEstimate
from validation.metrics.coverage import normalised_square
from validation.metrics.errors import distances_from_segment
from validation.metrics.mirror_check import seen_mirrors, wall_square
from validation.metrics.truth import Truth, front_face
from validation.random_rooms.oracle import Answerable

Verdict = Literal["right", "wrong", "open, truth among them", "open, truth not among them", "none"]
"""Of a user: found and right or wrong; ambiguous, the truth being one of the alternatives or none;
not found."""

REGION = 0.999
"""Probability of the region around a place in which the truth must be for it to be right. [-]"""
CONFIDENT = 0.99
"""Confidence of a mirror above which it must not be false. [-]"""
NEAR = 1e-3
"""Distance within which an alternative is right whatever its covariance, if it has one. [m]"""
AT_SOMETHING = 0.02
"""Distance from every wall and body beyond which a target is false: three cells λ/2D at the far end
of the room. [m]"""
ON_WALL = 0.005
"""Distance from a wall within which a target lies on it: a cell λ/2D. [m]"""


@dataclass(frozen=True, kw_only=True)
class RoomScore:
    """One room, answered. Holds numbers, words and tuples of them only, for JSON."""

    room: str  # name of its scenario
    verdict: Verdict
    status: str
    method: str
    bounces: int | None
    reason: str | None
    error: float | None  # of the first place named [m]
    square: float | None  # of that error over its covariance, in as many axes as it has [-]
    places: int  # that were named
    stated: tuple[tuple[float, bool], ...]  # probability of each place named; whether it is right
    answerable: bool  # by the oracle
    why: str  # or why not
    bound: float | None  # largest deviation by the Cramér-Rao bound, walls known [m]
    shown: tuple[str, ...]  # walls that the echo shows
    found: tuple[str, ...]  # walls on which a mirror was reported
    false_mirrors: int  # reported with confidence above 0.99, where no wall is
    doubtful_mirrors: int  # the same, with less
    wall_squares: tuple[float, ...]  # of right mirrors' errors over their covariances, in 2-D [-]
    targets: int
    false_targets: int  # where nothing is
    targets_on_walls: int
    seconds: float  # that the estimate took


def score_room(
    name: str,
    estimate: Estimate,
    truth: Truth,
    oracle: Answerable,
    *,
    flat: bool,
    seconds: float,
) -> RoomScore:
    """Compare the answer to a room of one user with the truth.

    Parameters
    ----------
    name
        The room's.
    estimate, truth
        What was said, and what is so.
    oracle
        What could have been said.
    flat
        Whether the room is two-dimensional.
    seconds
        That the estimate took.
    """
    (user,) = estimate.users
    place = truth.user_position[user.name]
    named = [one for one in (user, *user.alternatives) if one.position is not None]
    right = [_holds(one, place, flat=flat) for one in named]
    verdict: Verdict = "none"
    if user.status == "found":
        verdict = "right" if right and right[0] else "wrong"
    elif user.status == "ambiguous":
        verdict = "open, truth among them" if any(right) else "open, truth not among them"
    mirrors = seen_mirrors(estimate, truth)
    false = [one.confidence for one in mirrors if one.wall is None]
    at_something, on_walls = _target_distances(estimate.targets, truth)
    return RoomScore(
        room=name,
        verdict=verdict,
        status=user.status,
        method=user.method,
        bounces=user.bounces,
        reason=user.reason,
        error=None if user.position is None else float(np.linalg.norm(user.position - place)),
        square=_square(user, place, flat=flat),
        places=len(named),
        stated=tuple(
            (one.probability, held)
            for one, held in zip(named, right, strict=True)
            if one.probability is not None
        ),
        answerable=oracle.answerable,
        why=oracle.why,
        bound=oracle.deviation,
        shown=oracle.shown,
        found=tuple(sorted({one.wall for one in mirrors if one.wall is not None})),
        false_mirrors=sum(confidence > CONFIDENT for confidence in false),
        doubtful_mirrors=sum(confidence <= CONFIDENT for confidence in false),
        wall_squares=tuple(
            wall_square(mirror, truth, seen.wall)
            for mirror, seen in zip(estimate.mirrors, mirrors, strict=True)
            if flat and seen.wall is not None
        ),
        targets=len(estimate.targets),
        false_targets=int(np.sum(at_something > AT_SOMETHING)),
        targets_on_walls=int(np.sum(on_walls < ON_WALL)),
        seconds=seconds,
    )


def _square(user: UserEstimate, place: Float[np.ndarray, " 3"], *, flat: bool) -> float | None:
    if user.position is None or user.covariance is None:
        return None
    axes = 2 if flat else 3
    return normalised_square((user.position - place)[:axes], user.covariance[:axes, :axes])


def _holds(user: UserEstimate, place: Float[np.ndarray, " 3"], *, flat: bool) -> bool:
    """Tell whether the region around a place holds the truth."""
    if user.position is None:
        return False
    square = _square(user, place, flat=flat)
    inside = square is not None and square < float(chi2.ppf(REGION, 2 if flat else 3))
    near = user.status != "found" and float(np.linalg.norm(user.position - place)) < NEAR
    return inside or near


def _target_distances(
    targets: Sequence[Target], truth: Truth
) -> tuple[Float[np.ndarray, " targets"], Float[np.ndarray, " targets"]]:
    """Return how far targets are from anything that is there, and from walls. [m]."""
    places = np.array([one.position for one in targets]).reshape(-1, 3)
    walls = [
        distances_from_segment(places, truth.wall_start[name], truth.wall_end[name])
        for name in truth.wall_start
    ]
    bodies = [
        np.array([np.linalg.norm(place - front_face(truth, name, place)) for place in places])
        for name in truth.target_position
    ]
    nothing = np.full(len(places), np.inf)
    on_walls = np.min([nothing, *walls], axis=0)
    return np.min([on_walls, *bodies], axis=0), on_walls
