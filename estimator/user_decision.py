"""From a user's paths and the walls to a position, or to the reason why there is none."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from estimator.estimate import UserEstimate
from estimator.paths import Path
from estimator.projection import Projection, Wall, project

AGREE = float(chi2.ppf(0.999, df=2))
"""Squared distance, over its covariance, within which two positions are the same. [-]."""
RIVAL = 0.25
"""Share of energy, over the answer's, from which a contradicting path makes it ambiguous. [-]."""
END_DEVIATIONS = 3.0
LOOSE_PEAKS = 12
"""Strongest loose peaks between which an unseen wall is suspected."""


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """Where one path puts the user."""

    path: Path
    projection: Projection


def decide(
    name: str,
    paths: Sequence[Path],
    walls: Sequence[Wall],
    *,
    cell: float,
    imaged: bool,
    loose: Float[np.ndarray, "peaks 3"],
) -> UserEstimate:
    """Locate a user in the array's frame.

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
    loose
        Peaks of the image that lie on no wall, strongest first. [m]

    Returns
    -------
    ``found`` with the position that the paths agree on; ``ambiguous`` if strong paths
    contradict each other, the reflection is at a wall's very end, or a wall that is too
    smooth to be seen may be in the way, with the alternatives;
    ``not_found`` with the reason.
    """
    if not paths:
        return UserEstimate(name=name, status="not_found", reason="no wave stands out of the pilot")
    specular = [path for path in paths if path.specular]
    scattered = [path for path in paths if not path.specular]
    if sum(path.share for path in scattered) > sum(path.share for path in specular):
        strongest = max(scattered, key=lambda path: path.share)
        return UserEstimate(name=name, status="not_found", reason=_why_none(strongest))
    hypotheses = [
        Hypothesis(
            path=path,
            projection=project(
                path.wave.aoa, path.wave.path_length, walls, covariance=path.wave.covariance
            ),
        )
        for path in specular
    ]
    groups = _agreeing(hypotheses)
    answers = [_joined(name, group) for group in groups]
    energy = [sum(member.path.share for member in group) for group in groups]
    best = int(np.argmax(energy))
    rivals = [
        answer
        for answer, share, index in zip(answers, energy, range(len(groups)), strict=True)
        if index != best and share > RIVAL * energy[best]
    ]
    answer = answers[best]
    if rivals:
        reason = "paths of like strength end at different places"
        return replace(answer, status="ambiguous", reason=reason, alternatives=tuple(rivals))
    other = _past_the_end(name, groups[best][0], walls, cell)
    if other is not None:
        reason = "the path meets a wall at its very end: it may pass beside it"
        return replace(answer, status="ambiguous", reason=reason, alternatives=(other,))
    other = _over_an_unseen_wall(name, groups[best][0], loose)
    if other is not None:
        reason = (
            "the straight way passes between two points that may be the ends of a wall too smooth "
            "to be seen; over such a wall the user is elsewhere"
        )
        return replace(answer, status="ambiguous", reason=reason, alternatives=(other,))
    if not imaged:
        reason = "no echo was measured, so mirrors are unknown; this is the place without any"
        return replace(answer, status="ambiguous", reason=reason)
    return answer


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


def _agreeing(hypotheses: Sequence[Hypothesis]) -> list[list[Hypothesis]]:
    """Group hypotheses with the strongest one that they agree with."""
    groups: list[list[Hypothesis]] = []
    for hypothesis in hypotheses:
        for group in groups:
            first = group[0].projection
            between = (hypothesis.projection.position - first.position)[:2]
            spread = (hypothesis.projection.covariance + first.covariance)[:2, :2]
            if between @ np.linalg.solve(spread, between) < AGREE:
                group.append(hypothesis)
                break
        else:
            groups.append([hypothesis])
    return groups


def _joined(name: str, group: Sequence[Hypothesis]) -> UserEstimate:
    """Weigh agreeing positions by their covariances; path and angle are the strongest's."""
    information, weighted = np.zeros((2, 2)), np.zeros(2)
    for member in group:
        precision = np.linalg.inv(member.projection.covariance[:2, :2])
        information += precision
        weighted += precision @ member.projection.position[:2]
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = np.linalg.inv(information)
    position: Float[np.ndarray, " 3"] = np.append(covariance[:2, :2] @ weighted, 0.0)
    strongest = group[0]
    return replace(
        _placed(name, strongest.path, strongest.projection),
        status="found",
        position=position,
        covariance=covariance,
        path=np.vstack([strongest.projection.path[:-1], position]),
    )


def _placed(name: str, path: Path, projection: Projection) -> UserEstimate:
    """Tell where one path ends, as one of several answers."""
    return UserEstimate(
        name=name,
        status="ambiguous",
        position=projection.position,
        covariance=projection.covariance,
        bounces=len(projection.walls),
        aoa=path.wave.aoa,
        path_length=path.wave.path_length,
        path=projection.path,
    )


def _past_the_end(
    name: str, hypothesis: Hypothesis, walls: Sequence[Wall], cell: float
) -> UserEstimate | None:
    """Return the place of a user whose ray passes a wall that it only just meets or misses."""
    wave, met = hypothesis.path.wave, hypothesis.projection.walls
    deviation = END_DEVIATIONS * float(np.sqrt(wave.covariance[0, 0]))
    for turn in (cell + deviation, -cell - deviation):
        turned = project(wave.aoa + turn, wave.path_length, walls, covariance=wave.covariance)
        if turned.walls != met:
            chain = [walls[index] for index in turned.walls]
            place = project(wave.aoa, wave.path_length, _endless(chain), covariance=wave.covariance)
            return _placed(name, hypothesis.path, place)
    return None


def _endless(walls: Sequence[Wall]) -> list[Wall]:
    """Lengthen walls by a half to either side, so that a ray just beside one meets it."""
    return [
        replace(
            wall,
            start=wall.start - 0.5 * (wall.end - wall.start),
            end=wall.end + 0.5 * (wall.end - wall.start),
        )
        for wall in walls
    ]


def _over_an_unseen_wall(
    name: str, hypothesis: Hypothesis, loose: Float[np.ndarray, "peaks 3"]
) -> UserEstimate | None:
    """Return the user's place over a smooth wall between two loose points, if one is in the way.

    A smooth wall echoes from its ends alone, and reflects all the better.
    """
    if hypothesis.projection.walls:
        return None
    wave = hypothesis.path.wave
    points = loose[:LOOSE_PEAKS]
    for first, second in zip(*np.triu_indices(len(points), k=1), strict=True):
        wall = Wall(start=points[first], end=points[second], covariance=np.zeros((2, 2)))
        place = project(wave.aoa, wave.path_length, [wall], covariance=wave.covariance)
        if place.walls:
            return _placed(name, hypothesis.path, place)
    return None
