"""From a user's paths and the walls to a position, or to the reason why there is none.

Every path may come over the mirrors that its ray meets, or over others that it only just misses.
Each choice of paths and chains of mirrors is one hypothesis; those whose joint least squares
leave no more over than their covariances allow are consistent. The one that explains most energy
is the answer, paths that it does not explain are dropped, and it is ambiguous if another
consistent one explains nearly as much elsewhere.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from estimator.array.resolution_cell import Resolution
from estimator.channel.path_extraction_2d import Path, PathSet
from estimator.geometry.path_tracing_2d import project
from estimator.geometry.wall_2d import Wall, mirrored
from estimator.positioning.los_check import doubt_straight_way
from estimator.positioning.map_context import Surroundings
from estimator.positioning.weighted_least_squares import (
    Consensus,
    Sighting,
    block_covariance,
    solve_position,
)
from estimator.results.estimate import PathReport, UserEstimate

RIVAL = 0.25
"""Share of energy, over the answer's, from which a contradicting path makes it ambiguous. [-]."""
END_DEVIATIONS = 3.0
"""Deviations of the angle, beside the image's cell, by which a ray may meet another wall. [-]."""
SAME = float(chi2.ppf(0.999, df=2))
"""Squared distance, over its covariance, within which two positions are the same. [-]."""
SHARP = 10.0
"""A position known this many times better than the distance of its alternative cannot have
been hit by chance: two paths agree there. [-]."""


def decide(
    name: str,
    found: PathSet,
    walls: Sequence[Wall],
    *,
    resolution: Resolution,
    imaged: bool,
    unassigned_peaks: Float[np.ndarray, "peaks 3"],
    wall_covariance: Float[np.ndarray, "parameters parameters"] | None = None,
    clock_known: bool = True,
    reach: float = np.inf,
    widest: float = 1.0,
    contrast: float = np.inf,
) -> UserEstimate:
    """Locate a user in the array's frame.

    Parameters
    ----------
    name
        The user's.
    found
        Its paths.
    walls
        Mirrors at their true place.
    resolution
        Of the image: how well it tells where a wall ends.
    imaged
        Whether there was an echo at all: without, nothing is known of mirrors.
    loose
        Peaks of the image that lie on no wall, strongest first. [m]
    wall_covariance
        Of (angle, offset) of all walls, one after the other; ``None``: that of each alone.
    clock_known
        Whether delays are lengths; if not, the offset is found from two or more paths.
    reach
        How far the image shows what there is. [m]
    widest
        Sine of the angle from boresight to which it does. [-]
    contrast
        Intensity of the brightest in the image over its background. [-]

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
    room = Surroundings(
        walls=tuple(walls),
        wall_covariance=block_covariance(walls) if wall_covariance is None else wall_covariance,
        resolution=resolution,
        imaged=imaged,
        unassigned_peaks=unassigned_peaks,
        reach=reach,
        widest=widest,
        contrast=contrast,
    )
    answer = (_on_our_clock if clock_known else _on_any_clock)(name, found, room)
    if answer.status == "found" and not imaged:
        reason = "no echo was measured, so mirrors are unknown; this is the place without any"
        answer = replace(answer, status="ambiguous", reason=reason, line_of_sight=None)
    return answer


def _on_our_clock(name: str, found: PathSet, room: Surroundings) -> UserEstimate:
    specular = [index for index, path in enumerate(found.paths) if path.specular]
    scattered = [path for path in found.paths if not path.specular]
    energy = sum(found.paths[index].share for index in specular)
    if sum(path.share for path in scattered) > energy:
        strongest = max(scattered, key=lambda path: path.share)
        return UserEstimate(
            name=name,
            status="not_found",
            reason=_why_none(strongest),
            paths=_reports(found, (), {}),
        )
    chains = {index: _chains(found.paths[index].wave.path_length, found.paths[index], room)
              for index in specular}  # fmt: skip
    observed = np.array([[path.wave.aoa, path.wave.path_length] for path in found.paths])
    consistent = _consistent(chains, observed, found.covariance, room)
    best = _most_explained(consistent, found, chains)
    answer = _placed(name, best, found, room, chains)
    rivals = _rivals(best, consistent, found, chains)
    if rivals:
        return _ambiguous(
            answer,
            "paths of like strength end at different places",
            [_placed(name, rival, found, room, chains) for rival in rivals],
        )
    others = _other_chains(best, consistent)
    if others:
        reason = "the path meets a wall at its very end: it may pass beside it"
        if len(best.sightings) > 1:
            reason = "the same paths agree over other walls as well"
        return _ambiguous(
            answer, reason, [_placed(name, other, found, room, chains) for other in others]
        )
    if len(best.sightings) > 1:
        return answer
    (only,) = best.sightings
    return answer if only.chain else doubt_straight_way(answer, found.paths[only.path].wave, room)


def _on_any_clock(name: str, found: PathSet, room: Surroundings) -> UserEstimate:
    """Find the clock's offset from two paths, or say what one path leaves open."""
    chains = {
        index: _chains(path.free.radius, path, room) for index, path in enumerate(found.paths)
    }
    observed = np.array(
        [[path.free.aoa, path.free.path_length, path.free.radius] for path in found.paths]
    )
    consistent = _consistent(chains, observed, found.free_covariance, room)
    best = _most_explained(consistent, found, chains)
    answer = _placed(name, best, found, room, chains)
    if len(best.sightings) > 1:
        rivals = _rivals(best, consistent, found, chains) + _other_chains(best, consistent)
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


def _why_none(path: Path) -> str:
    where = f"{np.degrees(path.wave.aoa):.2f}°, {path.wave.path_length:.3f} m"
    if (length := path.unfolded) is not None:
        return (
            f"the path at {where} has the curvature of one {length:.2f} m long, beyond the "
            f"unambiguous {path.unambiguous:.2f} m; take smaller frequency steps"
        )
    return (
        f"the strongest wave ({where}) comes from a point about {path.free.radius:.2f} m away, "
        "not over that length: an edge or rough patch scatters it, and no mirror-like or direct "
        "path stands out; or the clocks differ"
    )


Chains = dict[int, tuple[tuple[int, ...], ...]]
"""For each path the chains of mirrors it may come over, the one that its ray meets first."""


def _chains(length: float, path: Path, room: Surroundings) -> tuple[tuple[int, ...], ...]:
    aoa, covariance = path.wave.aoa, np.zeros((2, 2))
    reach = room.resolution.across_ray
    reach += END_DEVIATIONS * float(np.sqrt(path.wave.covariance[0, 0]))
    met = [
        project(aoa + turn, length, room.walls, covariance=covariance).walls
        for turn in (0.0, reach, -reach)
    ]
    return tuple(dict.fromkeys(met))


def _consistent(
    chains: Chains,
    observed: Float[np.ndarray, "paths kinds"],
    covariance: Float[np.ndarray, "observations observations"],
    room: Surroundings,
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
                sightings, observed, covariance, room.walls, room.wall_covariance
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
    best: Consensus, consistent: Sequence[Consensus], found: PathSet, chains: Chains
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
            and not _same_place(one, best)
        ]
        if not others:
            return rivals
        rivals.append(_most_explained(others, found, chains))
        used |= {one.path for one in rivals[-1].sightings}


def _other_chains(best: Consensus, consistent: Sequence[Consensus]) -> list[Consensus]:
    """Return where the answer's paths end if they come over other mirrors.

    If two paths or more agree sharply, each of them alone over other mirrors is refuted.
    """
    paths = {one.path for one in best.sightings}
    others = []
    for one in consistent:
        theirs = {seen.path for seen in one.sightings}
        if one is best or not theirs <= paths or _same_place(one, best):
            continue
        if theirs < paths and _refutes(best, one):
            continue
        others.append(one)
    return others


def _refutes(best: Consensus, other: Consensus) -> bool:
    reach = np.sqrt(SAME * float(np.linalg.eigvalsh(best.covariance[:2, :2]).max()))
    return bool(np.linalg.norm(best.position - other.position) > SHARP * reach)


def _same_place(one: Consensus, other: Consensus) -> bool:
    between = (one.position - other.position)[:2]
    spread = (one.covariance + other.covariance)[:2, :2]
    return bool(between @ np.linalg.solve(spread, between) < SAME)


def _placed(
    name: str, consensus: Consensus, found: PathSet, room: Surroundings, chains: Chains
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
        aoa=wave.aoa,
        path_length=wave.path_length,
        path=vertices,
        line_of_sight=any(not one.chain for one in consensus.sightings),
        paths=_reports(found, consensus.sightings, chains),
        clock_offset=consensus.clock_offset,
        clock_deviation=consensus.clock_deviation,
    )


def _vertices(
    user: Float[np.ndarray, " 3"], chain: Sequence[Wall]
) -> Float[np.ndarray, "vertices 3"]:
    """Draw the path from the array over mirrors to the user, wherever these end. [m]."""
    images = [user]
    for wall in reversed(chain):
        images.append(mirrored(images[-1], wall.start, wall.end))
    place = np.zeros(3)
    vertices = [place]
    for wall, image in zip(chain, images[:0:-1], strict=True):
        ahead = image - place
        share = float((wall.start - place) @ wall.normal) / float(ahead @ wall.normal)
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
            if path.unfolded is not None:
                reason = "flatter than its delay: longer than what is unambiguous"
        elif index not in used:
            mirrors = chains[index][0]
            reason = "it ends elsewhere than the answer"
            if mirrors in used.values():
                reason = "a stronger path comes over the same mirrors: scattered beside it"
        reports.append(
            PathReport(
                aoa=path.wave.aoa,
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
