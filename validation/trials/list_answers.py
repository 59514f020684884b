"""Answers to path lists of drawn rooms against the truth, and what such lists hold.

The rooms are those of :mod:`validation.trials.path_lists`. Their frequencies of reflections and of
paths that are not listed are those that the priors of :mod:`estimator.path_consensus` stand for.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from estimator.path_consensus.consensus import locate_path_lists
from validation.metrics.coverage import normalised_square
from validation.trials.path_lists import KINDS, DrawnPaths, drawn_paths
from validation.trials.room_answers import Answers, told_by

RIGHT = 0.999
"""Probability of the region about a found user in which the truth must be. [-]"""
SAME_FOOT = 0.3
"""Distance of a mirror's plane from the true wall's, along its normal, within which it is found:
five deviations of angles of 2° seen from a few metres. [m]"""
SEED = 7300
"""Of the rooms, other than those of tests. [-]"""
MOST_ORDER = 3
"""Reflections of a path at most. [-]"""


def drawn_lists(count: int) -> list[DrawnPaths]:
    """Draw so many rooms of each kind, in the plane and in space, with a known clock."""
    return [
        drawn_paths(np.random.default_rng([SEED, number, index, space]), kind, space=bool(space))
        for number in range(count)
        for index, kind in enumerate(KINDS)
        for space in (0, 1)
    ]


def list_answers(rooms: Sequence[DrawnPaths]) -> Answers:
    """Locate the users of path lists, and count what is right and what is wrong."""
    errors: list[float] = []
    told = []
    right = walls = false_walls = 0
    for room in rooms:
        answer = locate_path_lists(room.lists, clock_offset=room.clock_offset)
        told.append(told_by(answer.users, answer.mirrors))
        for user, truth in zip(answer.users, room.users, strict=True):
            if user.status != "found" or user.position is None or user.covariance is None:
                continue
            axes = np.diag(user.covariance) > 0
            error = (user.position - truth)[axes]
            errors.append(float(np.linalg.norm(error)))
            square = normalised_square(error, user.covariance[np.ix_(axes, axes)])
            right += bool(square < chi2.ppf(RIGHT, axes.sum()))
        feet = room.offsets[:, None] * room.normals
        met = set()
        for mirror in answer.mirrors:
            apart = np.linalg.norm(feet - (mirror.start @ mirror.normal) * mirror.normal, axis=1)
            if apart.min() < SAME_FOOT:
                met.add(int(np.argmin(apart)))
            else:
                false_walls += int(mirror.confidence > RIGHT)
        walls += len(met)
    return Answers(
        right=right,
        wrong=len(errors) - right,
        median_error=float(np.median(errors)) if errors else np.nan,
        walls=walls,
        false_walls=false_walls,
        targets=0,
        false_targets=0,
        told=tuple(told),
    )


def listed_orders(rooms: Sequence[DrawnPaths]) -> Float[np.ndarray, " orders"]:
    """Return the shares of paths over none to :data:`MOST_ORDER` walls among those listed. [-]."""
    orders = [
        len(chain)
        for room in rooms
        for chains in room.chains
        for chain in chains
        if -1 not in chain
    ]
    counts = np.bincount(orders, minlength=MOST_ORDER + 1)
    return np.asarray(counts / counts.sum())


def unlisted_alone(rooms: Sequence[DrawnPaths]) -> float:
    """Return how often a wall that a list knows behind another is not listed by itself. [-]."""
    pairs = alone = 0
    for room in rooms:
        for chains in room.chains:
            for second in {chain[1] for chain in chains if len(chain) == 2}:
                pairs += 1
                alone += (second,) in chains
    return 1 - alone / pairs if pairs else float("nan")
