r"""Users and mirrors from path lists alone, or why they cannot be told.

What a room explains is not all that can be true. The posterior of each place sums over

* other places, from which the same mirrors explain its paths as well;
* none of them: its paths agree by chance;
* the whole room seen in a mirror A: paths over A alone, and over A and k, are for a base station
  those of a user behind A and of k's image there, and no geometry tells. Levels do, unless A is
  metal; and all paths then come from A's half of the directions;
* another clock.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.compute.distributions import chi_square_quantile, chi_square_tail
from estimator.measurement.errors import MeasurementError
from estimator.measurement.path_list import PathList
from estimator.path_consensus.flat_mirrors import chains_of
from estimator.path_consensus.listed_paths import ListedPaths, listed
from estimator.path_consensus.path_levels import level_gains
from estimator.path_consensus.reports import mirror_of, path_reports, unfolded_path
from estimator.path_consensus.room_search import (
    LEAST_VOTES,
    Room,
    found_room,
    placed_users,
    without,
)
from estimator.positioning.level_likelihood import BLOCKED
from estimator.positioning.posterior import CERTAIN, UNSEEN
from estimator.results.estimate import Mirror, UserEstimate

MOST_PLACES = 200
"""Places whose lists are solved together; the time grows with their square. [-]"""
UNSEEN_TOO = 0.5
"""Probability that the path over one mirror alone is not listed, where all that is listed comes
over one more: for each mirror that is found. Of drawn path lists with a second wall behind a first,
0.17 lack the second alone where nothing hides it, and 0.48 where a screen may: the larger leaves
more in doubt (``python -m validation.experiments.thresholds lists``). [-]"""
BY_CHANCE = 0.05
"""Prior probability that a place's paths have nothing to do with what explains them. What explains
one path more must gain ln 50 for the place to be certain; half and twice of the prior are ln 2 of
that. [-]"""
LEAST_TOLD = 0.75
"""Share of all paths that a room must explain. In rooms of tuning, right ones explained 0.83 to
0.93, wrong ones 0.45 to 0.70. [-]"""
HALF_SLACK = 1.0
"""Deviations of angles by which paths must lie within a half of space to do so: in its very edge no
wall stands. [-]"""
LEAST_FIT = 1e-6
"""Probability of what is left over, below which the errors are larger than told, or the clock is
not the same at all places. [-]"""
SAME = 0.999
"""Probability with which two estimates of one place pass for the same. [-]"""


@dataclass(frozen=True, kw_only=True)
class PathListAnswer:
    """Users of all lists, the mirrors, and what is to be said."""

    users: tuple[UserEstimate, ...]
    mirrors: tuple[Mirror, ...]
    notes: tuple[str, ...]


def locate_path_lists(lists: Sequence[PathList], *, clock_offset: float | None) -> PathListAnswer:
    """Find the users of path lists, and the mirrors that these agree on.

    Parameters
    ----------
    lists
        One for each place of a user, or for each user.
    clock_offset
        Users' clock minus the base station's; None: unknown, and the same for all lists. [s]

    Raises
    ------
    MeasurementError
        If there are too many lists.
    """
    if len(lists) > MOST_PLACES:
        raise MeasurementError(
            f"paths: {len(lists)} places, more than {MOST_PLACES}; give fewer at a time"
        )
    paths = listed(lists)
    if clock_offset is not None:
        paths = paths.later(speed_of_light * clock_offset)
    rooms = found_room(paths, clock_known=clock_offset is not None)
    room = rooms[0]
    doubt = _doubt(paths, rooms)
    flat = () if paths.axes == 3 else ("no elevations: all is taken to lie in the plane z = 0",)
    mirrored = _mirrored_odds(paths, room)
    users = tuple(
        _user(one.user, place, paths, room, doubt, mirrored, clock_known=clock_offset is not None)
        for place, one in enumerate(lists)
    )
    seen_over = [_mirrors_met(user) for user in users if user.status == "found"]
    mirrors = []
    for index in range(len(room.fit.mirrors)):
        less = without(paths, room, index, clock_known=clock_offset is not None)
        sure = sum(index in some for some in seen_over) >= LEAST_VOTES
        odds = np.exp(-min(room.evidence - less.evidence, 700.0)) + (mirrored if sure else 1.0)
        mirrors.append(mirror_of(paths, room, index, confidence=float(1 / (1 + odds))))
    told = int((room.chain >= 0).sum())
    note = f"{told} of {room.chain.size} listed paths are explained by {len(mirrors)} mirrors"
    return PathListAnswer(users=users, mirrors=tuple(mirrors), notes=(*flat, note))


def _mirrors_met(user: UserEstimate) -> set[int]:
    """Return the mirrors that used paths of a user met: who is in doubt proves none."""
    return {one for path in user.paths if path.used for one in path.mirrors or ()}


def _doubt(paths: ListedPaths, rooms: Sequence[Room]) -> str | None:
    """Say why no place can be believed, if so."""
    room = rooms[0]
    if not len(room.fit.mirrors):
        return (
            "no mirror is agreed on by paths of two places, so nothing tells whether the first "
            "path is the direct one; measure from more places"
        )
    told = float((room.chain >= 0).mean())
    if told < LEAST_TOLD:
        return (
            f"mirrors and users explain {told:.0%} of the paths only, less than {LEAST_TOLD:.0%}: "
            "direct paths may be hidden, or the deviations of angles and delays larger than told"
        )
    if room.fit.freedom > 0 and chi_square_tail(room.fit.chi_square, room.fit.freedom) < LEAST_FIT:
        ratio = np.sqrt(room.fit.chi_square / room.fit.freedom)
        return (
            f"what is left over is {ratio:.2f} times what the deviations of angles and delays "
            "allow: give larger ones; or the clock is not the same at all places"
        )
    for other in rooms[1:]:
        apart = abs(other.fit.offset - room.fit.offset)
        spread = np.hypot(other.fit.offset_deviation, room.fit.offset_deviation)
        if apart > 4 * spread and np.exp(other.evidence - room.evidence) > 1 - CERTAIN:
            late = 1e9 * other.fit.offset / speed_of_light
            return f"a clock offset of {late:.3f} ns explains the paths as well"
    if paths.level_db is None:
        return (
            "no calibrated levels: the whole room may be seen in a mirror, over which even the "
            "first paths come; give frequency_ghz if the levels are those of isotropic antennas"
        )
    return None


def _mirrored_odds(paths: ListedPaths, room: Room) -> float:
    """Return the odds that all of the room is seen in one more mirror. [-]."""
    excess = paths.excess_db(room.fit.offset)
    direct = np.flatnonzero(room.chain == 0)
    if excess is None or not direct.size:
        return 1.0
    # One wall, one loss, and one calibration: the mean counts once.
    mean = np.array([excess[direct].mean()])
    gains = level_gains(mean, paths.level_deviation_db)[0]
    prior = UNSEEN / (1 - UNSEEN) * BLOCKED * float(np.exp(gains[1] - gains[0]))
    before_users = UNSEEN_TOO ** len(room.fit.mirrors)
    return prior * (before_users + float(_from_one_side(paths, room)))


def _from_one_side(paths: ListedPaths, room: Room) -> bool:
    """Tell whether all explained paths may come from the front of one wall: from half of space."""
    from scipy.optimize import linprog  # takes long to import

    rays = paths.direction[room.chain >= 0]
    # The largest t with n·s ≥ t for all of them, n in a box.
    cost = np.append(np.zeros(paths.axes), -1.0)
    limits = np.concatenate([-rays, np.ones((len(rays), 1))], axis=1)
    bounds = [*[(-1.0, 1.0)] * paths.axes, (None, 1.0)]
    best = linprog(cost, A_ub=limits, b_ub=np.zeros(len(rays)), bounds=bounds)
    return best.fun is not None and bool(-best.fun > HALF_SLACK * paths.angle_deviation)


def _user(
    name: str,
    place: int,
    paths: ListedPaths,
    room: Room,
    doubt: str | None,
    mirrored: float,
    *,
    clock_known: bool,
) -> UserEstimate:
    fit, position = room.fit, room.fit.users[place]
    rows = np.flatnonzero(paths.place == place)
    reports = path_reports(paths, room, place)
    if not np.all(np.isfinite(position)):
        return UserEstimate(
            name=name,
            status="not_found",
            reason="no mirror that is known explains its paths, and none has the level of a "
            "direct one",
            paths=reports,
        )
    chains = chains_of(len(fit.mirrors))
    used = rows[room.chain[rows] >= 0]
    first = int(used[np.argmin(paths.length[used])])
    chain = chains[room.chain[first]]
    users, around, gains = placed_users(paths, place, room)
    apart = users - position
    spread = around + fit.user_covariance[place]
    square = np.einsum("ci,ci->c", apart, np.linalg.solve(spread, apart[..., None])[..., 0])
    here = square < chi_square_quantile(SAME, paths.axes)
    best = float(gains[here].max(initial=0.0))
    rivals = _distinct(users[~here], around[~here], gains[~here])
    likely = np.array([np.exp(min(gain - best, 700.0)) for _, _, gain in rivals])
    extra = best - float(room.gain[used].max())
    chance = BY_CHANCE * float(np.exp(-max(extra, 0.0)))
    total = 1.0 + float(likely.sum()) + chance + mirrored
    probability = 1 / total
    clock = None if clock_known else fit.offset / speed_of_light
    answer = UserEstimate(
        name=name,
        status="found" if doubt is None and probability >= CERTAIN else "ambiguous",
        position=_in_space(position),
        covariance=_square(fit.user_covariance[place]),
        bounces=len(chain),
        aoa=float(np.arccos(np.clip(paths.direction[first, 0], -1, 1))),
        elevation=float(np.arcsin(paths.direction[first, 2])) if paths.axes == 3 else None,
        path_length=float(paths.length[first]),
        path=_in_space(unfolded_path(position, fit.mirrors, chain)),
        line_of_sight=bool((room.chain[used] == 0).any()) if doubt is None else None,
        paths=reports,
        clock_offset=clock,
        clock_deviation=None if clock_known else fit.offset_deviation / speed_of_light,
        probability=probability if doubt is None else None,
    )
    if answer.status == "found":
        return answer
    reason = doubt
    if reason is None:
        parts = {
            "its paths agree with another place as well": float(likely.sum()),
            "too few of its paths are explained": chance,
            "the whole room may be seen in a mirror: the first paths are no stronger than over a "
            "metal wall, or all paths come from one side of the base station": mirrored,
        }
        reason = max(parts, key=lambda one: parts[one])
    others = tuple(
        UserEstimate(
            name=name,
            status="ambiguous",
            position=_in_space(where),
            covariance=_square(covariance),
            probability=float(share) / total if doubt is None else None,
        )
        for (where, covariance, _), share in zip(rivals, likely, strict=True)
        if share > 1 - CERTAIN
    )
    return replace(answer, reason=reason, alternatives=others, line_of_sight=None)


def _distinct(
    users: Float[np.ndarray, "candidates axes"],
    around: Float[np.ndarray, "candidates axes axes"],
    gains: Float[np.ndarray, " candidates"],
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Take the likeliest of each group of candidates at one place."""
    kept: list[tuple[np.ndarray, np.ndarray, float]] = []
    for user, spread, gain in zip(users, around, gains, strict=True):
        limit = chi_square_quantile(SAME, user.size)
        if not any(
            (user - other) @ np.linalg.solve(spread + near, user - other) < limit
            for other, near, _ in kept
        ):
            kept.append((user, spread, float(gain)))
    return kept


def _in_space(points: Float[np.ndarray, "*grid axes"]) -> Float[np.ndarray, "*grid 3"]:
    missing = 3 - points.shape[-1]
    return np.concatenate([points, np.zeros((*points.shape[:-1], missing))], axis=-1)


def _square(covariance: Float[np.ndarray, "axes axes"]) -> Float[np.ndarray, "3 3"]:
    square = np.zeros((3, 3))
    square[: len(covariance), : len(covariance)] = covariance
    return square
