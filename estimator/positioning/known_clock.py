"""A user synchronised with the base station: its position by the posterior over hypotheses.

:mod:`estimator.positioning.posterior` weighs all consistent hypotheses, and the hypothesis that
none of them is true. A position with at least 0.999 of the posterior is the answer, and paths that
it does not explain are dropped; otherwise the answer is ambiguous and lists all positions with
their probabilities.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from estimator.channel.path import Path, PathSet
from estimator.geometry.bearing import Bearing
from estimator.geometry.specular_chains import Chain
from estimator.positioning.hypotheses import Chains, consistent_ones, end_reach, same_place
from estimator.positioning.los_check import StraightWay, look_along, look_along_legs
from estimator.positioning.map_context import MapContext
from estimator.positioning.position_report import ambiguous, path_reports, placed
from estimator.positioning.posterior import (
    CERTAIN,
    beside,
    chain_probabilities,
    log_weight,
    strong_unexplained,
    unseen_odds,
)
from estimator.positioning.through_walls import behind_the_wall, through_odds
from estimator.positioning.weighted_least_squares import Consensus
from estimator.results.estimate import UserEstimate

NEGLIGIBLE = 1e-6
"""Probability of a place below which it is not named: a thousandth of the doubt in a certain one.
[-]"""
SCATTERER = 0.01
"""Difference between the length of a path over a body and that over the source of its wavefront:
a cylinder's is half its radius behind its surface, and the bodies that scatter as one point here
have radii of a centimetre or less. [m]"""
UNSEEN_SOMEWHERE = (
    "the path is weaker than a direct one, or comes from where little is shown: a wall that the "
    "image does not show may have reflected it"
)
THROUGH_THE_WALL = "the wave may have come through the wall that seems to reflect it"
THROUGH_A_PANE = (
    "the level of the path falls over the band as that of a wave through a pane or a board: the "
    "user may be nearer by the delay in it"
)


def on_our_clock(name: str, found: PathSet, room: MapContext) -> UserEstimate:
    """Locate a user whose delays are lengths.

    Parameters
    ----------
    name, found, room
        As for :func:`estimator.positioning.decision_rules.decide`.
    """
    specular = [index for index, path in enumerate(found.paths) if path.specular]
    scattered = [path for path in found.paths if not path.specular]
    energy = sum(found.paths[index].share for index in specular)
    chances = {
        index: chain_probabilities(
            found.paths[index].wave.path_length,
            found.paths[index],
            room,
            found,
            end_reach(found.paths[index], room),
        )
        for index in specular
    }
    chains = {index: _ordered(some) for index, some in chances.items()}
    consistent = consistent_ones(chains, found, room)
    answer = _decided(name, consistent, found, room, chains, chances) if consistent else None
    left = [
        path
        for path in scattered
        if answer is None or not _scattered_on_the_way(path, answer.position, found.how)
    ]
    if answer is None or sum(path.share for path in left) > energy:
        strongest = max(left, key=lambda path: path.share)
        return UserEstimate(
            name=name,
            status="not_found",
            reason=_why_none(strongest, found.how),
            paths=path_reports(found, (), {}),
        )
    return answer


def _scattered_on_the_way(path: Path, user: Float[np.ndarray, " 3"] | None, how: Bearing) -> bool:
    """Tell whether a path's length is that from a user over the source of its wavefront."""
    if user is None:
        return False
    source = path.radius * how.towards(path.wave.bearing)
    detour = float(np.linalg.norm(user - source)) + path.radius
    error = 3 * path.free.curvature_deviation * path.radius**2
    return abs(path.wave.path_length - detour) < SCATTERER + error


def _decided(
    name: str,
    consistent: Sequence[Consensus],
    found: PathSet,
    room: MapContext,
    chains: Chains,
    chances: Mapping[int, Mapping[Chain, float]],
) -> UserEstimate:
    """Decide by the posterior over all explanations, "none of them" included."""
    logs = [log_weight(one, found, room, chances) for one in consistent]
    ways: dict[int, StraightWay] = {}
    through: dict[int, float] = {}
    odds = []
    for number, one in enumerate(consistent):
        odds.append(0.0)
        if len(one.sightings) > 1 or logs[number] < max(logs) + np.log(NEGLIGIBLE):
            continue
        alone = placed(name, one, found, room, chains)
        (only,) = one.sightings
        wave = found.paths[only.path].wave
        if only.chain:
            way = look_along_legs(alone, wave, only.chain, room, found.how, found.frequency)
        else:
            way = look_along(alone, wave, room, found.how, found.frequency)
        through[number] = through_odds(one, found, room, way.sight)
        ways[number] = way
        odds[-1] = unseen_odds(one, found, room, way) + through[number]
    weights = np.exp(np.array(logs) - max(logs))
    total = float((weights * (1 + np.array(odds))).sum())
    places = _places(consistent, weights / total, found.how)
    best, probability = places[0]
    answer = placed(name, consistent[best], found, room, chains)
    assert answer.covariance is not None
    spread = _spread(consistent, weights, best, found, room)
    answer = replace(answer, covariance=answer.covariance + spread, probability=probability)
    if probability >= CERTAIN:
        return answer
    others = [
        replace(placed(name, consistent[index], found, room, chains), probability=share)
        for index, share in places[1:]
        if share > NEGLIGIBLE
    ]
    passed = float(weights[best] * through.get(best, 0.0) / total)
    unseen = float(weights[best] * odds[best] / total) - passed
    # That nothing is on a straight way is said at once; what seems reflected has two sides.
    if passed > (NEGLIGIBLE if answer.bounces else 1 - CERTAIN):
        behind = behind_the_wall(answer, consistent[best], found)
        others.append(replace(behind, probability=passed))
    elsewhere = ways[best].otherwise if best in ways else None
    if elsewhere is not None and unseen > NEGLIGIBLE:
        others.append(replace(elsewhere, probability=unseen))
    contradicted = strong_unexplained(consistent[best], found, room)
    elsewhere_too = sum(share for _, share in places[1:])
    if passed >= max(unseen, elsewhere_too) and not contradicted:
        why = THROUGH_THE_WALL if answer.bounces else THROUGH_A_PANE
        open_answer = ambiguous(answer, why, others)
        return replace(_likeliest_first(open_answer), line_of_sight=None)
    if best in ways and unseen >= elsewhere_too and not contradicted:
        doubt = ways[best].doubt or UNSEEN_SOMEWHERE
        return replace(ambiguous(answer, doubt, others), line_of_sight=None)
    paths = {one.path for one in consistent[best].sightings}
    same = all(
        {one.path for one in consistent[index].sightings} <= paths
        for index, share in places[1:]
        if share > NEGLIGIBLE
    )
    reason = "paths of like strength end at different places"
    if same and len(paths) > 1:
        reason = "the same paths agree over other walls as well"
    elif same and not contradicted:
        reason = "the path meets a wall at its very end: it may pass beside it"
    return ambiguous(answer, reason, others)


def _likeliest_first(answer: UserEstimate) -> UserEstimate:
    """Exchange an open answer for its likeliest alternative, if that is likelier."""
    best = max(answer.alternatives, key=lambda one: one.probability or 0.0)
    if (best.probability or 0.0) <= (answer.probability or 0.0):
        return answer
    others = [answer, *(one for one in answer.alternatives if one is not best)]
    alternatives = tuple(replace(one, alternatives=(), reason=None) for one in others)
    return replace(best, reason=answer.reason, alternatives=alternatives)


def _places(
    consistent: Sequence[Consensus], shares: Float[np.ndarray, " weights"], how: Bearing
) -> list[tuple[int, float]]:
    """Group explanations by position: index of the likeliest and total probability of each."""
    places: list[tuple[int, float]] = []
    for index in np.argsort(-shares, kind="stable"):
        for number, (first, share) in enumerate(places):
            if same_place(consistent[first], consistent[index], how):
                places[number] = (first, share + float(shares[index]))
                break
        else:
            places.append((int(index), float(shares[index])))
    return sorted(places, key=lambda place: -place[1])


def _spread(
    consistent: Sequence[Consensus],
    weights: Float[np.ndarray, " weights"],
    best: int,
    found: PathSet,
    room: MapContext,
) -> Float[np.ndarray, "3 3"]:
    """Return how far explanations of one place lie apart, weighted, as a covariance. [m²].

    Two waves that describe one front, bent by roughness, end at places that neither's covariance
    tells the distance of. Each is as likely as its share of their energy: the front's direction is
    that of the patches of the mirror that contribute most, by chance.
    """
    chosen = consistent[best]
    weighed = weights[best]
    spread = np.zeros((3, 3))
    parts = np.zeros((3, 3))
    for index, one in enumerate(consistent):
        if index == best:
            continue
        away = one.position - chosen.position
        if same_place(chosen, one, found.how):
            weighed += weights[index]
            spread += weights[index] * np.outer(away, away)
        elif (share := _share_of_part(one, chosen, found, room)) > 0:
            parts += share * np.outer(away, away)
    return np.asarray(spread / weighed + parts)


def _share_of_part(one: Consensus, other: Consensus, found: PathSet, room: MapContext) -> float:
    """Return the share of energy of one explanation's path, if both are parts of one front.

    Of a direct wave's front there are none: nothing bends it.
    """
    if len(one.sightings) != 1 or len(other.sightings) != 1:
        return 0.0
    (part,), (rest,) = one.sightings, other.sightings
    if not part.chain or part.chain != rest.chain:
        return 0.0
    if not beside(found.paths[part.path], found.paths[rest.path], room):
        return 0.0
    shares = found.paths[part.path].share, found.paths[rest.path].share
    return shares[0] / sum(shares)


def _ordered(chances: Mapping[Chain, float]) -> tuple[Chain, ...]:
    return tuple(sorted(chances, key=lambda chain: -chances[chain]))


def _why_none(path: Path, how: Bearing) -> str:
    where = f"{how.told(path.wave.bearing)}, {path.wave.path_length:.3f} m"
    if (length := path.dealiased_length) is not None:
        return (
            f"the path at {where} has the curvature of one {length:.2f} m long, beyond the "
            f"unambiguous {path.unambiguous:.2f} m; take smaller frequency steps"
        )
    return (
        f"the strongest wave ({where}) comes from a point about {path.radius:.2f} m away, "
        "not over that length: an edge or rough patch scatters it, and no mirror-like or direct "
        "path stands out; or the clocks differ"
    )
