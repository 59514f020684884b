"""A user's result: its position, the path to it, and the use or rejection of each other path."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from estimator.channel.path import PathSet
from estimator.geometry.flat_wall import FlatWall
from estimator.positioning.hypotheses import Chains
from estimator.positioning.map_context import MapContext
from estimator.positioning.weighted_least_squares import Consensus, Sighting
from estimator.results.estimate import PathReport, UserEstimate


def placed(
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
        paths=path_reports(found, consensus.sightings, chains),
        clock_offset=consensus.clock_offset,
        clock_deviation=consensus.clock_deviation,
    )


def ambiguous(
    answer: UserEstimate, reason: str, alternatives: Sequence[UserEstimate]
) -> UserEstimate:
    """Leave an answer open beside its alternatives; whether it is in sight, if all say so."""
    others = tuple(replace(other, status="ambiguous") for other in alternatives)
    seen = {one.line_of_sight for one in (answer, *others)}
    return replace(
        answer,
        status="ambiguous",
        reason=reason,
        alternatives=others,
        line_of_sight=seen.pop() if len(seen) == 1 else None,
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


def path_reports(
    found: PathSet, sightings: Sequence[Sighting], chains: Chains
) -> tuple[PathReport, ...]:
    """Tell of each path over which mirrors it came, or why it is not used."""
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
