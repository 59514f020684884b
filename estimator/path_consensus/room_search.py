"""A room that explains the paths of all places: mirrors one by one, then the clock.

The first path of each place is tried as the direct one. Mirrors that most places agree on are added
while the evidence grows; then each place is looked for anew over all chains of them, so that
places without a direct path are found, too.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from estimator.path_consensus.explanations import (
    candidate_users,
    explained,
    likelihoods,
    paired,
)
from estimator.path_consensus.flat_mirrors import no_mirrors
from estimator.path_consensus.joint_fit import JointFit, fitted, nothing_fitted
from estimator.path_consensus.listed_paths import FARTHEST, ListedPaths
from estimator.path_consensus.mirror_votes import proposed_mirror

MOST_MIRRORS = 10
"""Mirrors of a room; their pairs make a hundred chains. [-]"""
LEAST_VOTES = 2
"""Places, its own included, that must see a mirror: one alone proves none. [-]"""
LEAST_EVIDENCE = 3.0
"""Logarithm of the evidence for a mirror, from which it is kept: 20 to 1. [-]"""
MOST_FAILURES = 5
"""Proposals in turn that may add no evidence before no more are looked at. [-]"""
LEVEL_DEVIATIONS = 2.5
"""Deviations within which a level is that of a direct path: 99 of a hundred are. [-]"""
SEEDS = 4
"""Earliest paths of a place that are unfolded to candidates of it: they met few mirrors. [-]"""
MOST_CANDIDATES = 12
"""Candidates of a place whose paths are paired one to one. [-]"""
WELL_TOLD = 0.6
"""Share of a place's paths that is explained, from which it is not looked for anew. [-]"""
PASSES = 3
"""Fits and new pairings in turn after each change; they settle in two. [-]"""
SCANNED = 10
"""Places that the search for the clock looks at. [-]"""
SCAN_MIRRORS = 2
"""Mirrors that it looks for. [-]"""
NEAREST = 0.3
"""Shortest direct way that an unknown clock may leave: inside the antennas' near field, sounders
tell no angles. [m]"""
MOST_CLOCKS = 3
"""Maxima of the scan over clocks that are fitted. [-]"""


@dataclass(frozen=True, kw_only=True)
class Room:
    """Mirrors and users that explain the paths, and how well."""

    fit: JointFit
    chain: Int[np.ndarray, " paths"]  # index of each path's chain; −1: unexplained
    gain: Float[np.ndarray, " paths"]  # log-likelihood over that of paths from anywhere [-]
    evidence: float  # logarithm, over that of a room without mirrors [-]


def mirror_cost(paths: ListedPaths) -> float:
    """Return the logarithm of the prior volume of one mirror: all directions and distances."""
    return float(np.log((2 * np.pi if paths.axes == 2 else 4 * np.pi) * FARTHEST / 2))


def found_room(paths: ListedPaths, *, clock_known: bool) -> tuple[Room, ...]:
    """Find the room that explains the paths best; with an unknown clock, rivals follow it."""
    if clock_known:
        clocks = [0.0]
    else:
        clocks = _clocks(paths)
    rooms = [_grown(paths, start, clock_known=clock_known) for start in clocks]
    return tuple(sorted(rooms, key=lambda one: -one.evidence))


def first_images(
    paths: ListedPaths, offset: float, *, by_level: bool = False
) -> tuple[Float[np.ndarray, "places axes"], Float[np.ndarray, "places axes axes"]]:
    """Return where the first path of each place comes from, and its covariance. [m], [m²].

    By level, the first of those that are as strong as a direct one; NaN where there is none.
    """
    able = paths.length + offset > 0
    excess = paths.excess_db(offset)
    if by_level and excess is not None:
        able &= np.abs(excess) < LEVEL_DEVIATIONS * paths.level_deviation_db
    images, covariance = paths.images(offset), paths.covariance(offset)
    users = np.full((paths.places, paths.axes), np.nan)
    around = np.full((paths.places, paths.axes, paths.axes), np.nan)
    for place in range(paths.places):
        rows = np.flatnonzero((paths.place == place) & able)
        if rows.size:
            first = rows[np.argmin(paths.length[rows])]
            users[place], around[place] = images[first], covariance[first]
    return users, around


def _grown(paths: ListedPaths, start: float, *, clock_known: bool) -> Room:
    users, around = first_images(paths, start, by_level=True)
    if np.isfinite(users).all(axis=1).sum() < LEAST_VOTES:
        users, around = first_images(paths, start)
    nothing = nothing_fitted(paths, no_mirrors(paths.axes), start)
    room = _settled(paths, users, around, nothing, clock_known=True)
    refused = np.zeros(paths.place.size, dtype=bool)
    failures = 0
    while len(room.fit.mirrors) < MOST_MIRRORS and failures < MOST_FAILURES:
        held = room.fit
        proposal = proposed_mirror(
            paths, held.users, held.user_covariance, (room.chain < 0) & ~refused, held.offset
        )
        if proposal is None or proposal.votes < LEAST_VOTES or proposal.gain < LEAST_EVIDENCE:
            break
        added = replace(held, mirrors=held.mirrors.and_one(proposal.normal, proposal.offset))
        bigger = _settled(paths, held.users, held.user_covariance, added, clock_known=clock_known)
        bigger = _replaced(paths, bigger, clock_known=clock_known)
        if bigger.evidence < room.evidence + LEAST_EVIDENCE:
            refused |= proposal.voters
            failures += 1
            continue
        room, failures = bigger, 0
        refused[:] = False
    return _pruned(paths, room, clock_known=clock_known)


def _settled(
    paths: ListedPaths,
    users: Float[np.ndarray, "places axes"],
    around: Float[np.ndarray, "places axes axes"],
    guess: JointFit,
    *,
    clock_known: bool,
) -> Room:
    """Pair and fit in turn."""
    fit = replace(guess, users=users, user_covariance=around)
    told = explained(paths, fit.mirrors, users, fit.offset, around)
    for _ in range(PASSES):
        before = told.chain
        fit = fitted(paths, before, fit.mirrors, fit.users, fit.offset, clock_known=clock_known)
        told = explained(paths, fit.mirrors, fit.users, fit.offset)
        if np.array_equal(told.chain, before):
            break
    count = len(fit.mirrors)
    clock = 0.0 if clock_known else -np.log(FARTHEST)
    evidence = _users_volume(paths, fit) + float(told.gain.sum()) + clock
    if count or not clock_known:
        evidence += fit.log_volume - count * mirror_cost(paths)
    return Room(fit=fit, chain=told.chain, gain=told.gain, evidence=evidence)


def user_volumes(
    paths: ListedPaths, covariance: Float[np.ndarray, "users axes axes"]
) -> Float[np.ndarray, " users"]:
    """Return the logarithms of places' volumes, over that of all places [-]."""
    # Flat over direction and distance, as paths from anywhere are: one path tells nothing.
    whole = np.linalg.slogdet(2 * np.pi * covariance)[1]
    return np.asarray(0.5 * whole)


def _users_volume(paths: ListedPaths, fit: JointFit) -> float:
    known = np.isfinite(fit.users).all(axis=1)
    distance = np.linalg.norm(fit.users[known], axis=1)
    volumes = user_volumes(paths, fit.user_covariance[known])
    return float((volumes - (paths.axes - 1) * np.log(distance) + paths.log_clutter).sum())


def placed_users(
    paths: ListedPaths, place: int, room: Room
) -> tuple[
    Float[np.ndarray, "candidates axes"],
    Float[np.ndarray, "candidates axes axes"],
    Float[np.ndarray, " candidates"],
]:
    """Return where the user may be at a place, the covariance, and the log-likelihood of each.

    These are the likeliest ones, the best first.
    """
    rows = np.flatnonzero(paths.place == place)
    fit = room.fit
    early = rows[np.argsort(paths.length[rows], kind="stable")[:SEEDS]]
    early = early[paths.length[early] + fit.offset > 0]
    users, around = candidate_users(paths, early, fit.mirrors, fit.offset)
    likely = likelihoods(paths, rows, fit.mirrors, users[:, None], fit.offset, around[:, None])
    bound = np.maximum(likely, 0.0).max(axis=2).sum(axis=1)
    best = np.argsort(-bound, kind="stable")[:MOST_CANDIDATES]
    gains = np.array([paired(likely[index])[1].sum() for index in best])
    order = np.argsort(-gains, kind="stable")
    return users[best[order]], around[best[order]], gains[order]


def _replaced(paths: ListedPaths, room: Room, *, clock_known: bool) -> Room:
    """Look for the user anew at each place that is badly explained, and keep what explains more."""
    users, around = room.fit.users.copy(), room.fit.user_covariance.copy()
    moved = False
    for place in range(paths.places):
        rows = paths.place == place
        told = int((room.chain[rows] >= 0).sum())
        if told >= WELL_TOLD * rows.sum() and told > 2:
            continue
        places, spreads, gains = placed_users(paths, place, room)
        if not gains.size:
            continue
        if not np.isfinite(users[place]).all() or gains[0] > room.gain[rows].sum() + 1.0:
            users[place], around[place], moved = places[0], spreads[0], True
    if not moved:
        return room
    other = _settled(paths, users, around, room.fit, clock_known=clock_known)
    return other if other.evidence > room.evidence else room


def _pruned(paths: ListedPaths, room: Room, *, clock_known: bool) -> Room:
    """Leave mirrors out that others explain as well, with some places looked for anew.

    A place whose direct path is missing may have been put behind a mirror, with mirrors of its own
    there.
    """
    while len(room.fit.mirrors):
        tried = [
            _replaced(
                paths,
                without(paths, room, index, clock_known=clock_known),
                clock_known=clock_known,
            )
            for index in range(len(room.fit.mirrors))
        ]
        best = max(tried, key=lambda one: one.evidence)
        if best.evidence < room.evidence - LEAST_EVIDENCE:
            return room
        room = best
    return room


def without(paths: ListedPaths, room: Room, index: int, *, clock_known: bool) -> Room:
    """Leave one mirror out, and fit again."""
    held = room.fit
    less = replace(held, mirrors=held.mirrors.without(index))
    return _settled(
        paths,
        held.users,
        held.user_covariance,
        less,
        clock_known=clock_known or not len(less.mirrors),
    )


def _clocks(paths: ListedPaths) -> list[float]:
    """Scan the offset; return the likeliest ones."""
    chosen = np.unique(np.linspace(0, paths.places - 1, SCANNED).round().astype(int))
    part = paths.part(np.isin(paths.place, chosen), chosen)
    shortest = float(paths.length.min())
    # A millionth of the distance more at each step would not be noticed; a part of it is.
    ways = NEAREST * (FARTHEST / NEAREST) ** np.linspace(0, 1, 121)
    scores = []
    for way in ways:
        offset = float(way) - shortest
        users, around = first_images(part, offset)
        free = np.ones(part.place.size, dtype=bool)
        total = 0.0
        for _ in range(SCAN_MIRRORS):
            proposal = proposed_mirror(part, users, around, free, offset)
            if proposal is None:
                break
            total += proposal.gain
            free &= ~proposal.voters
        scores.append(total)
    score = np.array([-np.inf, *scores, -np.inf])
    peaks = np.flatnonzero((score[1:-1] >= score[:-2]) & (score[1:-1] > score[2:]))
    best = peaks[np.argsort(-score[1:-1][peaks], kind="stable")][:MOST_CLOCKS]
    return [float(ways[index]) - shortest for index in best]
