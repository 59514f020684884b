"""Scores of estimates in random rooms against the truth and the oracle."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from estimator.results.estimate import Estimate, UserEstimate
from validation.metrics.coverage import normalised_square
from validation.metrics.mirror_check import seen_mirrors, wall_square
from validation.metrics.target_association import target_distances
from validation.metrics.truth import Truth, with_box_faces
from validation.random_rooms.oracle import Answerable

Verdict = Literal["right", "wrong", "open, truth among them", "open, truth not among them", "none"]
"""Verdict on a user: found, and right or wrong; ambiguous, with or without the truth among the
alternatives; not found."""

REGION = 0.999
"""Probability of the confidence region that must hold the truth for a position to be right. [-]"""
CONFIDENT = 0.99
"""Confidence of a mirror above which it must not be false. [-]"""
NEAR = 1e-3
"""Distance from the truth within which an alternative is right, whatever its covariance. [m]"""
AT_SOMETHING = 0.02
"""Distance from every wall and body above which a target is false: three cells λ/2D at the far end
of the room. [m]"""
ON_WALL = 0.005
"""Distance from a wall within which a target counts as on it: a cell λ/2D. [m]"""


@dataclass(frozen=True, kw_only=True)
class RoomScore:
    """Score of one room, of numbers, strings and tuples only, for JSON."""

    room: str  # name of its scenario
    verdict: Verdict
    status: str
    method: str
    bounces: int | None
    reason: str | None
    error: float | None  # of the first position stated [m]
    square: float | None  # normalised square of that error [-]
    places: int  # positions stated, alternatives included
    stated: tuple[tuple[float, bool], ...]  # probability of each position; whether it is right
    answerable: bool  # according to the oracle
    why: str  # reason, if not
    bound: float | None  # largest deviation by the Cramér-Rao bound, walls known [m]
    shown: tuple[str, ...]  # walls that the echo shows
    found: tuple[str, ...]  # walls on which a mirror was reported
    false_mirrors: int  # reported with confidence above 0.99, on no wall and no face of a box
    doubtful_mirrors: int  # the same, with less
    wall_squares: tuple[float, ...]  # normalised squares of right mirrors' errors, in 2-D [-]
    targets: int
    false_targets: int  # far from every wall and body
    targets_on_walls: int
    seconds: float  # duration of the estimate


def score_room(
    name: str,
    estimate: Estimate,
    truth: Truth,
    oracle: Answerable,
    *,
    flat: bool,
    seconds: float,
) -> RoomScore:
    """Compare the estimate in a room of one user with the truth.

    Parameters
    ----------
    name
        Of the room.
    estimate, truth
        The estimate and the truth.
    oracle
        Result of the oracle.
    flat
        Whether the room is two-dimensional.
    seconds
        Duration of the estimate.
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
    walled = with_box_faces(truth)
    mirrors = seen_mirrors(estimate, walled)
    false = [one.confidence for one in mirrors if one.wall is None]
    at_something, on_walls = target_distances(estimate.targets, truth)
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
            wall_square(mirror, walled, seen.wall)
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
    """Return whether the confidence region of a position holds the truth."""
    if user.position is None:
        return False
    square = _square(user, place, flat=flat)
    inside = square is not None and square < float(chi2.ppf(REGION, 2 if flat else 3))
    near = user.status != "found" and float(np.linalg.norm(user.position - place)) < NEAR
    return inside or near
