"""From a user's paths and the walls to a position, or to the reason why there is none.

Every path may come over the mirrors that its ray meets, or over others that it only just misses.
Each choice of paths and chains of mirrors is one hypothesis; those whose joint least squares
leave no more over than their covariances allow are consistent.
:mod:`estimator.positioning.posterior` weighs them, and that the truth is none of them. A place that
holds 0.999 of the posterior is the answer, paths that it does not explain are dropped; else it is
ambiguous, and all places are told with their probabilities.
"""

# Over 400 lines: known clocks go by the posterior, unknown ones by older rules, on the same paths.

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light
from scipy.stats import chi2

from estimator import false_alarm
from estimator.channel.path import Path, PathSet
from estimator.geometry.bearing import Bearing
from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.path_tracing import trace
from estimator.geometry.specular_chains import Chain
from estimator.positioning.los_check import StraightWay, look_along, look_along_legs
from estimator.positioning.map_context import MapContext
from estimator.positioning.posterior import (
    CERTAIN,
    chain_probabilities,
    log_weight,
    strong_unexplained,
    unseen_odds,
)
from estimator.positioning.weighted_least_squares import Consensus, Sighting, solve_position
from estimator.results.estimate import PathReport, UserEstimate

RIVAL = 0.25
"""Share of energy, over the answer's, from which a contradicting path makes it ambiguous. [-]."""
Chains = dict[int, tuple[Chain, ...]]
"""For each path the chains of mirrors it may come over, the one that its ray meets first."""

END_DEVIATIONS = 3.0
"""Deviations of the angle, beside the image's cell, by which a ray may meet another wall. [-]."""
SAME = 1 - false_alarm.DISAGREEMENT
"""Probability with which two estimates of one position pass for the same. [-]"""
NEGLIGIBLE = 1e-6
"""Probability of a place below which it is not named. [-]"""
UNSEEN_SOMEWHERE = (
    "the path is weaker than a direct one, or comes from where little is shown: a wall that the "
    "image does not show may have reflected it"
)
UNSEEN_BEYOND = (
    "beyond the wall the path passes between two points that may be the ends of another wall, too "
    "smooth to be seen"
)
SHARP = 10.0
"""A position known this many times better than the distance of its alternative cannot have
been hit by chance: two paths agree there. [-]."""


def decide(
    name: str, found: PathSet, room: MapContext, *, clock_known: bool = True
) -> UserEstimate:
    """Locate a user in the array's frame, in the plane or in space.

    Parameters
    ----------
    name
        The user's.
    found
        Its paths.
    room
        What the echo told of the room.
    clock_known
        Whether delays are lengths; if not, the offset is found from two or more paths.

    Returns
    -------
    ``found`` with the position that the paths agree on; ``ambiguous`` if strong paths
    contradict each other, the reflection is at a wall's very end, a wall that is too smooth or
    an echo too noisy to be seen may be in the way, or one path alone has no known clock, with the
    alternatives;
    ``not_found`` with the reason.
    """
    if not found.paths:
        return UserEstimate(name=name, status="not_found", reason="no wave stands out of the pilot")
    answer = (_on_our_clock if clock_known else _on_any_clock)(name, found, room)
    if answer.status == "found" and not room.imaged:
        reason = "no echo was measured, so mirrors are unknown; this is the place without any"
        answer = replace(answer, status="ambiguous", reason=reason, line_of_sight=None)
    return answer


def _on_our_clock(name: str, found: PathSet, room: MapContext) -> UserEstimate:
    specular = [index for index, path in enumerate(found.paths) if path.specular]
    scattered = [path for path in found.paths if not path.specular]
    energy = sum(found.paths[index].share for index in specular)
    if sum(path.share for path in scattered) > energy:
        strongest = max(scattered, key=lambda path: path.share)
        return UserEstimate(
            name=name,
            status="not_found",
            reason=_why_none(strongest, found.how),
            paths=_reports(found, (), {}),
        )
    chances = {
        index: chain_probabilities(
            found.paths[index].wave.path_length,
            found.paths[index],
            room,
            found,
            _reach(found.paths[index], room),
        )
        for index in specular
    }
    chains = {index: _ordered(some) for index, some in chances.items()}
    consistent = _consistent(chains, found, room)
    return _decided(name, consistent, found, room, chains, chances)


def _decided(
    name: str,
    consistent: Sequence[Consensus],
    found: PathSet,
    room: MapContext,
    chains: Chains,
    chances: Mapping[int, Mapping[Chain, float]],
) -> UserEstimate:
    """Answer by the posterior over all explanations, and that it is none of them."""
    logs = [log_weight(one, found, room, chances) for one in consistent]
    ways: dict[int, StraightWay] = {}
    odds = []
    for number, one in enumerate(consistent):
        odds.append(0.0)
        if len(one.sightings) > 1 or logs[number] < max(logs) + np.log(NEGLIGIBLE):
            continue
        alone = _placed(name, one, found, room, chains)
        (only,) = one.sightings
        if only.chain:
            assert alone.path is not None
            sight = look_along_legs(alone.path, room, found.how)
            way = StraightWay(sight=sight, doubt=None if sight == "clear" else UNSEEN_BEYOND)
        else:
            way = look_along(alone, found.paths[only.path].wave, room, found.how)
        ways[number] = way
        odds[-1] = unseen_odds(one, found, room, way.sight)
    weights = np.exp(np.array(logs) - max(logs))
    total = float((weights * (1 + np.array(odds))).sum())
    places = _places(consistent, weights / total, found.how)
    best, probability = places[0]
    answer = replace(_placed(name, consistent[best], found, room, chains), probability=probability)
    if probability >= CERTAIN:
        return answer
    others = [
        replace(_placed(name, consistent[index], found, room, chains), probability=share)
        for index, share in places[1:]
        if share > NEGLIGIBLE
    ]
    unseen = float(weights[best] * odds[best] / total)
    elsewhere = ways[best].otherwise if best in ways else None
    if elsewhere is not None and unseen > NEGLIGIBLE:
        others.append(replace(elsewhere, probability=unseen))
    contradicted = strong_unexplained(consistent[best], found, room)
    elsewhere_too = sum(share for _, share in places[1:])
    if best in ways and unseen >= elsewhere_too and not contradicted:
        doubt = ways[best].doubt or UNSEEN_SOMEWHERE
        return replace(_ambiguous(answer, doubt, others), line_of_sight=None)
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
    return _ambiguous(answer, reason, others)


def _places(
    consistent: Sequence[Consensus], shares: Float[np.ndarray, " weights"], how: Bearing
) -> list[tuple[int, float]]:
    """Put explanations of one place together: the likeliest of each, and their probability."""
    places: list[tuple[int, float]] = []
    for index in np.argsort(-shares, kind="stable"):
        for number, (first, share) in enumerate(places):
            if _same_place(consistent[first], consistent[index], how):
                places[number] = (first, share + float(shares[index]))
                break
        else:
            places.append((int(index), float(shares[index])))
    return sorted(places, key=lambda place: -place[1])


def _on_any_clock(name: str, found: PathSet, room: MapContext) -> UserEstimate:
    """Find the clock's offset from two paths, or say what one path leaves open."""
    chains = {
        index: _chains(path.radius, path, room, found.how) for index, path in enumerate(found.paths)
    }
    consistent = _consistent(chains, found, room, clock_known=False)
    best = _most_explained(consistent, found, chains)
    answer = _placed(name, best, found, room, chains)
    if len(best.sightings) > 1:
        rivals = _rivals(best, consistent, found, chains, room) + _other_chains(
            best, consistent, found.how
        )
        if rivals:
            return _ambiguous(
                answer,
                "other paths, or other walls, give another place and another clock offset",
                [_placed(name, rival, found, room, chains) for rival in rivals],
            )
        return answer
    path = found.paths[best.sightings[0].path]
    assert answer.clock_offset is not None
    assert answer.clock_deviation is not None
    said = f"{1e9 * answer.clock_offset:.3f} ± {1e9 * answer.clock_deviation:.3f} ns"
    if not path.specular:
        return _ambiguous(
            answer,
            "the user's clock offset is unknown, and one path alone tells it by its wavefront's "
            f"curvature only ({said}); this is the place if no edge or rough patch scattered it",
            [],
        )
    plain = _on_our_clock(name, found, room)
    if plain.position is None:
        return plain
    return replace(
        plain,
        status="ambiguous",
        reason="the user's clock offset is unknown, and one path alone cannot tell it: this is the "
        f"place if it is 0, which the wavefront's curvature agrees with ({said})",
        alternatives=(*plain.alternatives, replace(answer, status="ambiguous")),
    )


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


def _chains(length: float, path: Path, room: MapContext, how: Bearing) -> tuple[Chain, ...]:
    bearing = path.wave.bearing
    met = [
        trace(how.towards(turned), length, room.walls)[1]
        for turned in (bearing, *how.around(bearing, _reach(path, room)))
    ]
    return tuple(dict.fromkeys(met))


def _reach(path: Path, room: MapContext) -> float:
    """Angle by which a path's ray may be off a wall's end. [rad]."""
    size = path.wave.bearing.size
    variance = float(path.wave.covariance[:size, :size].trace())
    return room.resolution.across_ray + END_DEVIATIONS * float(np.sqrt(variance))


def _ordered(chances: Mapping[Chain, float]) -> tuple[Chain, ...]:
    return tuple(sorted(chances, key=lambda chain: -chances[chain]))


def _consistent(
    chains: Chains, found: PathSet, room: MapContext, *, clock_known: bool = True
) -> list[Consensus]:
    """Solve all choices of paths and chains; two paths never come over the same mirrors."""
    choices = [
        [None, *(Sighting(path=index, chain=chain) for chain in options)]
        for index, options in chains.items()
    ]
    consistent = []
    for choice in product(*choices):
        sightings = [one for one in choice if one is not None]
        if sightings and len({one.chain for one in sightings}) == len(sightings):
            solved = solve_position(
                sightings,
                found.observed if clock_known else found.free_observed,
                found.covariance if clock_known else found.free_covariance,
                room.walls,
                room.wall_covariance,
                how=found.how,
                clock_known=clock_known,
            )
            if solved.agrees:
                consistent.append(solved)
    return consistent


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
            and not _same_place(one, best, found.how)
            and not _comes_unseen(one, best, found, room)
        ]
        if not others:
            return rivals
        rivals.append(_most_explained(others, found, chains))
        used |= {one.path for one in rivals[-1].sightings}


def _comes_unseen(rival: Consensus, best: Consensus, found: PathSet, room: MapContext) -> bool:
    """Tell whether a rival's paths may come over walls that the image cannot show.

    Floor and ceiling stand outside of the angles that most planar arrays image. What arrives from
    there contradicts nothing, if it is the longer way: no place farther off than one of the
    answer's paths is long can be the user's.
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
        if one is best or not theirs <= paths or _same_place(one, best, how):
            continue
        if theirs < paths and _refutes(best, one, how):
            continue
        others.append(one)
    return others


def _refutes(best: Consensus, other: Consensus, how: Bearing) -> bool:
    axes = how.coordinates
    spread = best.covariance[np.ix_(axes, axes)]
    reach = np.sqrt(_same(how) * float(np.linalg.eigvalsh(spread).max()))
    return bool(np.linalg.norm(best.position - other.position) > SHARP * reach)


def _same_place(one: Consensus, other: Consensus, how: Bearing) -> bool:
    axes = how.coordinates
    between = (one.position - other.position)[axes]
    spread = (one.covariance + other.covariance)[np.ix_(axes, axes)]
    return bool(between @ np.linalg.solve(spread, between) < _same(how))


def _same(how: Bearing) -> float:
    """Squared distance, over its covariance, within which two positions are the same. [-]."""
    return float(chi2.ppf(SAME, df=len(how.coordinates)))


def _placed(
    name: str, consensus: Consensus, found: PathSet, room: MapContext, chains: Chains
) -> UserEstimate:
    """Tell where a consensus puts the user; path and angle are those of its strongest path."""
    strongest = min(consensus.sightings, key=lambda one: one.path)
    wave = found.paths[strongest.path].wave
    vertices = _vertices(consensus.position, [room.walls[i] for i in strongest.chain])
    return UserEstimate(
        name=name,
        status="found",
        position=consensus.position,
        covariance=consensus.covariance,
        bounces=len(strongest.chain),
        aoa=found.how.aoa(wave.bearing),
        elevation=found.how.elevation(wave.bearing),
        path_length=wave.path_length,
        path=vertices,
        line_of_sight=any(not one.chain for one in consensus.sightings),
        paths=_reports(found, consensus.sightings, chains),
        clock_offset=consensus.clock_offset,
        clock_deviation=consensus.clock_deviation,
    )


def _vertices(
    user: Float[np.ndarray, " 3"], chain: Sequence[FlatWall]
) -> Float[np.ndarray, "vertices 3"]:
    """Draw the path from the array over mirrors to the user, wherever these end. [m]."""
    images = [user]
    for wall in reversed(chain):
        images.append(wall.mirrored(images[-1]))
    place = np.zeros(3)
    vertices = [place]
    for wall, image in zip(chain, images[:0:-1], strict=True):
        ahead = image - place
        share = float((wall.point - place) @ wall.normal) / float(ahead @ wall.normal)
        place = place + share * ahead
        vertices.append(place)
    return np.stack([*vertices, user])


def _reports(
    found: PathSet, sightings: Sequence[Sighting], chains: Chains
) -> tuple[PathReport, ...]:
    used = {one.path: one.chain for one in sightings}
    reports = []
    for index, path in enumerate(found.paths):
        reason, mirrors = None, used.get(index)
        if index not in chains:
            reason = "rounder than its delay: an edge or a rough patch scattered it"
            if path.dealiased_length is not None:
                reason = "flatter than its delay: longer than what is unambiguous"
        elif index not in used:
            mirrors = chains[index][0]
            reason = "it ends elsewhere than the answer"
            if mirrors in used.values():
                reason = "a stronger path comes over the same mirrors: scattered beside it"
        reports.append(
            PathReport(
                aoa=found.how.aoa(path.wave.bearing),
                elevation=found.how.elevation(path.wave.bearing),
                path_length=path.wave.path_length,
                share=path.share,
                mirrors=mirrors,
                used=index in used,
                reason=reason,
            )
        )
    return tuple(reports)


def _ambiguous(
    answer: UserEstimate, reason: str, alternatives: Sequence[UserEstimate]
) -> UserEstimate:
    others = tuple(replace(other, status="ambiguous") for other in alternatives)
    seen = {one.line_of_sight for one in (answer, *others)}
    return replace(
        answer,
        status="ambiguous",
        reason=reason,
        alternatives=others,
        line_of_sight=seen.pop() if len(seen) == 1 else None,
    )
