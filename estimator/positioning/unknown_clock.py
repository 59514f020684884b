"""A user with an unknown clock offset: two paths determine it, one path alone does not.

The hypothesis that explains most energy is the answer, paths that it does not explain are dropped,
and it is ambiguous if another consistent one explains nearly as much elsewhere.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.constants import speed_of_light

from estimator.channel.path import Path, PathSet
from estimator.geometry.bearing import Bearing
from estimator.geometry.path_tracing import trace
from estimator.geometry.specular_chains import Chain
from estimator.positioning.hypotheses import (
    Chains,
    consistent_ones,
    end_reach,
    same_place,
    same_square,
)
from estimator.positioning.known_clock import on_our_clock
from estimator.positioning.map_context import MapContext
from estimator.positioning.position_report import ambiguous, path_reports, placed
from estimator.positioning.posterior import beside
from estimator.positioning.weighted_least_squares import Consensus
from estimator.results.estimate import UserEstimate

RIVAL = 0.25
"""Share of energy, over the answer's, from which a contradicting path makes it ambiguous: half the
amplitude. With half and twice of it the answers in ten rooms, one of them on an unknown clock, are
the same (``python -m validation.experiments.thresholds decisions``). [-]"""
SHARP = 10.0
"""A position known this many times better than the distance of its alternative cannot have
been hit by chance: two paths agree there. [-]"""


def on_any_clock(name: str, found: PathSet, room: MapContext) -> UserEstimate:
    """Estimate position and clock offset from two paths; ambiguous with one path only."""
    chains = {
        index: _chains(path.radius, path, room, found.how) for index, path in enumerate(found.paths)
    }
    consistent = [
        one
        for one in consistent_ones(chains, found, room, clock_known=False)
        if not _of_one_wave(one, found, room)
    ]
    if not consistent:
        return UserEstimate(
            name=name,
            status="not_found",
            reason="the user's clock offset is unknown, and the waves are too flat to tell how far "
            "away it is",
            paths=path_reports(found, (), chains),
        )
    best = _most_explained(consistent, found, chains)
    answer = placed(name, best, found, room, chains)
    if len(best.sightings) > 1:
        rivals = _rivals(best, consistent, found, chains, room) + _other_chains(
            best, consistent, found.how
        )
        if rivals:
            return ambiguous(
                answer,
                "other paths, or other walls, give another place and another clock offset",
                [placed(name, rival, found, room, chains) for rival in rivals],
            )
        return answer
    path = found.paths[best.sightings[0].path]
    assert answer.clock_offset is not None
    assert answer.clock_deviation is not None
    said = f"{1e9 * answer.clock_offset:.3f} ± {1e9 * answer.clock_deviation:.3f} ns"
    if not path.specular:
        return ambiguous(
            answer,
            "the user's clock offset is unknown, and one path alone tells it by its wavefront's "
            f"curvature only ({said}); this is the place if no edge or rough patch scattered it",
            [],
        )
    plain = on_our_clock(name, found, room)
    if plain.position is None:
        return plain
    return replace(
        plain,
        status="ambiguous",
        reason="the user's clock offset is unknown, and one path alone cannot tell it: this is the "
        f"place if it is 0, which the wavefront's curvature agrees with ({said})",
        alternatives=(*plain.alternatives, replace(answer, status="ambiguous")),
    )


def _chains(length: float, path: Path, room: MapContext, how: Bearing) -> tuple[Chain, ...]:
    bearing = path.wave.bearing
    met = [
        trace(how.towards(turned), length, room.walls)[1]
        for turned in (bearing, *how.around(bearing, end_reach(path, room)))
    ]
    return tuple(dict.fromkeys(met))


def _of_one_wave(consensus: Consensus, found: PathSet, room: MapContext) -> bool:
    """Tell whether two paths are parts of one wave that roughness bends: they tell no offset."""
    paths = [found.paths[one.path] for one in consensus.sightings]
    return any(beside(one, other, room) for one, other in combinations(paths, 2))


def _energy(consensus: Consensus, found: PathSet) -> float:
    return sum(found.paths[one.path].share for one in consensus.sightings)


def _most_explained(consistent: Sequence[Consensus], found: PathSet, chains: Chains) -> Consensus:
    def rank(one: Consensus) -> tuple[float, int, float]:
        straight = sum(chains[seen.path][0] == seen.chain for seen in one.sightings)
        return round(_energy(one, found), 9), straight, -one.chi_square

    return max(consistent, key=rank)


def _rivals(
    best: Consensus,
    consistent: Sequence[Consensus],
    found: PathSet,
    chains: Chains,
    room: MapContext,
) -> list[Consensus]:
    """Return what the paths that the answer does not explain say, if they are strong."""
    rivals: list[Consensus] = []
    used = {one.path for one in best.sightings}
    while True:
        others = [
            one
            for one in consistent
            if not used & {seen.path for seen in one.sightings}
            and _energy(one, found) > RIVAL * _energy(best, found)
            and not same_place(one, best, found.how)
            and not _comes_unseen(one, best, found, room)
        ]
        if not others:
            return rivals
        rivals.append(_most_explained(others, found, chains))
        used |= {one.path for one in rivals[-1].sightings}


def _comes_unseen(rival: Consensus, best: Consensus, found: PathSet, room: MapContext) -> bool:
    """Tell whether a rival's paths may come over walls that the image cannot show.

    Floor and ceiling lie outside the angles that most planar arrays image. A path from there that
    is
    longer than the answer's paths is no contradiction: the user cannot be farther away than the
    length of its shortest path.
    """
    late = speed_of_light * (best.clock_offset or 0.0)
    shortest = min(found.paths[one.path].wave.path_length for one in best.sightings) + late
    if np.linalg.norm(rival.position) <= shortest:
        return False
    headings = [found.how.towards(found.paths[one.path].wave.bearing) for one in rival.sightings]
    return not any(room.shows(heading) for heading in headings)


def _other_chains(
    best: Consensus, consistent: Sequence[Consensus], how: Bearing
) -> list[Consensus]:
    """Return where the answer's paths end if they come over other mirrors.

    If two paths or more agree sharply, each of them alone over other mirrors is refuted.
    """
    paths = {one.path for one in best.sightings}
    others = []
    for one in consistent:
        theirs = {seen.path for seen in one.sightings}
        if one is best or not theirs <= paths or same_place(one, best, how):
            continue
        if theirs < paths and _refutes(best, one, how):
            continue
        others.append(one)
    return others


def _refutes(best: Consensus, other: Consensus, how: Bearing) -> bool:
    axes = how.coordinates
    spread = best.covariance[np.ix_(axes, axes)]
    reach = np.sqrt(same_square(how) * float(np.linalg.eigvalsh(spread).max()))
    return bool(np.linalg.norm(best.position - other.position) > SHARP * reach)
