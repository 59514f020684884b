"""From a user's paths and the walls of a room to a position in space, or why there is none."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from estimator.channel.path_extraction_3d import SpacePath
from estimator.geometry.path_tracing_3d import SpaceProjection, project_in_space
from estimator.geometry.wall_3d import PlaneWall
from estimator.positioning.los_check import hides_walls, too_noisy
from estimator.results.estimate import UserEstimate

AGREE = float(chi2.ppf(0.999, df=3))
"""Squared distance, over its covariance, within which two positions are the same. [-]."""
RIVAL = 0.25
"""Share of energy, over the answer's, from which a contradicting path makes it ambiguous. [-]."""
END_DEVIATIONS = 3.0


@dataclass(frozen=True, kw_only=True)
class SpaceHypothesis:
    """Where one path puts the user."""

    path: SpacePath
    projection: SpaceProjection


def decide_in_space(
    name: str,
    paths: Sequence[SpacePath],
    walls: Sequence[PlaneWall],
    *,
    cell: float,
    imaged: bool,
    contrast: float = np.inf,
) -> UserEstimate:
    """Locate a user in a planar array's frame.

    Parameters
    ----------
    name
        The user's.
    paths
        Strongest first.
    walls
        Mirrors at their true place.
    cell
        How well the image tells where a wall ends, as an angle. [rad]
    imaged
        Whether there was an echo at all: without, nothing is known of mirrors.
    contrast
        Intensity of the brightest in the image over its background. [-]

    Returns
    -------
    ``found`` with the position that the paths agree on; ``ambiguous`` if a strong path that is
    no longer contradicts it (a longer one may always come over a wall that is not seen), or a
    wall ends where the path meets it, with the alternatives, or if the echo is too noisy to show
    walls; ``not_found`` with the reason.
    """
    if not paths:
        return UserEstimate(name=name, status="not_found", reason="no wave stands out of the pilot")
    specular = [path for path in paths if path.specular]
    scattered = [path for path in paths if not path.specular]
    if sum(path.share for path in scattered) > sum(path.share for path in specular):
        strongest = max(scattered, key=lambda path: path.share)
        return UserEstimate(name=name, status="not_found", reason=_why_none(strongest))
    hypotheses = [
        SpaceHypothesis(path=path, projection=_projected(path, walls)) for path in specular
    ]
    groups = _agreeing(hypotheses)
    energy = [sum(member.path.share for member in group) for group in groups]
    best = int(np.argmax(energy))
    answer = _joined(name, groups[best])
    length = min(member.path.wave.path_length for member in groups[best])
    rivals = tuple(
        _joined(name, group)
        for index, group in enumerate(groups)
        if index != best
        and energy[index] > RIVAL * energy[best]
        and min(member.path.wave.path_length for member in group) < length
    )
    if rivals:
        reason = "a shorter path of like strength ends at another place"
        return replace(answer, status="ambiguous", reason=reason, alternatives=rivals)
    others = _past_an_end(name, groups[best][0], walls, cell)
    if others and len(groups[best]) == 1:
        reason = "the path meets a wall where that ends in the image: it may pass beside it"
        return replace(answer, status="ambiguous", reason=reason, alternatives=others)
    if not imaged:
        reason = "no echo was measured, so mirrors are unknown; this is the place without any"
        return replace(answer, status="ambiguous", reason=reason)
    if not walls and hides_walls(contrast):
        reason = too_noisy(contrast)
        return replace(answer, status="ambiguous", reason=reason, line_of_sight=None)
    return answer


def _projected(
    path: SpacePath, walls: Sequence[PlaneWall], *, margin: float = 0.0
) -> SpaceProjection:
    wave = path.wave
    return project_in_space(
        wave.cosines, wave.path_length, walls, covariance=wave.covariance, margin=margin
    )


def _why_none(path: SpacePath) -> str:
    along, up = (np.degrees(np.arcsin(cosine)) for cosine in path.wave.cosines)
    where = f"{along:.2f}° aside, {up:.2f}° up, {path.wave.path_length:.3f} m"
    if (length := path.unfolded) is not None:
        return (
            f"the path at {where} has the curvature of one {length:.2f} m long, beyond the "
            f"unambiguous {path.unambiguous:.2f} m; take smaller frequency steps"
        )
    return (
        f"the strongest wave ({where}) comes from a point about "
        f"{1 / max(path.free.curvature, 1e-3):.2f} m away, not over that length: an edge or rough "
        "patch scatters it, and no mirror-like or direct path stands out; or the clocks differ"
    )


def _agreeing(hypotheses: Sequence[SpaceHypothesis]) -> list[list[SpaceHypothesis]]:
    """Group hypotheses with the strongest one that they agree with."""
    groups: list[list[SpaceHypothesis]] = []
    for hypothesis in hypotheses:
        for group in groups:
            first = group[0].projection
            between = hypothesis.projection.position - first.position
            spread = hypothesis.projection.covariance + first.covariance
            if between @ np.linalg.solve(spread, between) < AGREE:
                group.append(hypothesis)
                break
        else:
            groups.append([hypothesis])
    return groups


def _joined(name: str, group: Sequence[SpaceHypothesis]) -> UserEstimate:
    """Weigh agreeing positions by their covariances; path and angle are the strongest's."""
    information, weighted = np.zeros((3, 3)), np.zeros(3)
    for member in group:
        precision = np.linalg.inv(member.projection.covariance)
        information += precision
        weighted += precision @ member.projection.position
    covariance = np.linalg.inv(information)
    position = covariance @ weighted
    strongest = group[0]
    return replace(
        _placed(name, strongest.path, strongest.projection),
        status="found",
        position=position,
        covariance=covariance,
        path=np.vstack([strongest.projection.path[:-1], position]),
    )


def _placed(name: str, path: SpacePath, projection: SpaceProjection) -> UserEstimate:
    """Tell where one path ends, as one of several answers."""
    along, up = path.wave.cosines
    return UserEstimate(
        name=name,
        status="ambiguous",
        position=projection.position,
        covariance=projection.covariance,
        bounces=len(projection.walls),
        aoa=float(np.arccos(along)),
        elevation=float(np.arcsin(up)),
        path_length=path.wave.path_length,
        path=projection.path,
        line_of_sight=not projection.walls,
    )


def _past_an_end(
    name: str, hypothesis: SpaceHypothesis, walls: Sequence[PlaneWall], cell: float
) -> tuple[UserEstimate, ...]:
    """Return where the user is if the walls are a cell wider, or narrower, than they look."""
    wave, met = hypothesis.path.wave, hypothesis.projection.walls
    angle = cell + END_DEVIATIONS * float(np.sqrt(wave.covariance[:2, :2].trace()))
    others = []
    for sign in (1.0, -1.0):
        other = _projected(hypothesis.path, walls, margin=sign * angle * wave.path_length)
        if other.walls != met:
            others.append(_placed(name, hypothesis.path, other))
    return tuple(others)
