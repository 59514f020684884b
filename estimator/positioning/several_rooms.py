"""One answer from those in several rooms, of which one is the true one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from estimator.geometry.bearing import Bearing
from estimator.positioning.hypotheses import same_square
from estimator.positioning.position_report import ambiguous
from estimator.positioning.posterior import CERTAIN
from estimator.results.estimate import UserEstimate

SAME_PLACE = 1e-3
"""Distance within which two places are one, whatever their covariances. [m]"""
NEGLIGIBLE = 1e-3
"""Probability of a place below which it is not told. [-]"""
WHERE_WALLS_STAND = (
    "a wall that the path may come over, or be blocked by, may stand at one of several distances"
)


def over_several_rooms(
    answers: Sequence[tuple[float, UserEstimate]], *, how: Bearing
) -> UserEstimate:
    """Weigh the answers in several rooms by the rooms' probabilities.

    Parameters
    ----------
    answers
        The probability of each room, and the answer in it.
    how
        What the array measures of a direction.

    Returns
    -------
    ``found`` where one place has all probability but a thousandth; else the likeliest place with
    the others as alternatives; ``not_found`` where no room has a user.
    """
    total = sum(chance for chance, _ in answers)
    places: list[tuple[float, UserEstimate]] = []
    for chance, answer in answers:
        for share, place in _shares(answer):
            places.append((share * chance / total, place))
    if not places:
        return max(answers, key=lambda one: one[0])[1]
    places.sort(key=lambda one: -one[0])
    groups: list[tuple[float, UserEstimate]] = []
    for share, place in places:
        for number, (before, first) in enumerate(groups):
            if _same(first, place, how):
                groups[number] = (before + share, first)
                break
        else:
            groups.append((share, place))
    groups.sort(key=lambda one: -one[0])
    share, best = groups[0]
    best = replace(best, alternatives=(), probability=share)
    others = [
        replace(other, alternatives=(), reason=None, probability=chance)
        for chance, other in groups[1:]
        if chance > NEGLIGIBLE
    ]
    if share >= CERTAIN and best.status == "found":
        return replace(best, reason=None)
    # In one room alone it may be open for a reason of its own.
    firsts = [answer for _, answer in answers if answer.position is not None]
    agree = len(firsts) == len(answers) and all(_same(firsts[0], one, how) for one in firsts)
    reason = best.reason if agree and best.reason is not None else WHERE_WALLS_STAND
    return ambiguous(best, reason, others)


def _shares(answer: UserEstimate) -> list[tuple[float, UserEstimate]]:
    """Return an answer's places with their probabilities, shared evenly where none is stated."""
    places = [one for one in (answer, *answer.alternatives) if one.position is not None]
    if any(one.probability is None for one in places):
        return [(1 / len(places), one) for one in places]
    return [(one.probability or 0.0, one) for one in places]


def _same(one: UserEstimate, other: UserEstimate, how: Bearing) -> bool:
    assert one.position is not None
    assert other.position is not None
    axes = how.coordinates
    between: Float[np.ndarray, " axes"] = (one.position - other.position)[axes]
    if np.linalg.norm(between) < SAME_PLACE:
        return True
    if one.covariance is None or other.covariance is None:
        return False
    spread = (one.covariance + other.covariance)[np.ix_(axes, axes)]
    square = between @ np.linalg.solve(spread, between)
    return bool(square < same_square(how))
