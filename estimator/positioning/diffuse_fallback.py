"""What diffuse scattering off the walls adds to the answer from a user's mirror-like paths."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator import false_alarm
from estimator.compute.distributions import chi_square_quantile
from estimator.geometry.bearing_2d import LINEAR
from estimator.geometry.path_tracing import trace
from estimator.geometry.wall_2d import Wall, mirrored
from estimator.measurement.model import Uplink
from estimator.positioning.diffuse_positioning import DiffuseFix, search_diffuse
from estimator.positioning.posterior import CERTAIN
from estimator.positioning.wall_anchors import SeenWall
from estimator.results.estimate import UserEstimate
from estimator.walls.fitted_line import FittedLine

MOST_ENERGY = 0.5
"""Share of the pilot's energy from which paths are not given up for what a wall scatters: most of
it, since shares add up to 1 and what the wall scatters then has less. In five of the rooms of
``python -m validation.experiments.thresholds decisions`` 0.25 and 0.9 change nothing: paths and
diffuse field agree, or the paths hold hardly any energy. [-]"""

CELLS_APART = 3.0
"""Cross-range cells λR/D from a strong path's place at which the diffuse field contradicts it:
walls that are not quite where they were found move both, and each in its own way. [-]"""

ALONE, BEHIND = 0.6, 0.05
"""Probability of a place that one wall's scattering alone tells, and of its image behind it: 8 of
14 such places in 125 random rooms were right, and none was behind the wall. [-]"""
TOGETHER = 0.9995
"""Probability of a place that scattering off two walls, or scattering and a path, tell: one less
half of the doubt that :data:`estimator.positioning.posterior.CERTAIN` allows, the other half of
which is left to places that scatter alike. [-]"""

UNSTATED = 0.5
"""Probability of an answer that states none: nothing is known for or against it. [-]"""
LEAST_DOUBT = 1e-9
"""Least probability of the contrary that odds are divided by: they stay finite. [-]"""

SAME_BOUNCE = 1e-3
"""Distance within which two paths are reflected at one place: both follow the same wave. [m]"""

SAME = chi_square_quantile(1 - false_alarm.DISAGREEMENT, 2)
"""Squared distance, over its covariance, within which two positions are the same. [-]."""


def with_diffuse_search(
    answer: UserEstimate,
    uplink: Uplink,
    lines: Sequence[FittedLine],
    walls: Sequence[Wall],
    seen_through: Sequence[tuple[int, ...]],
) -> UserEstimate:
    """Search a user by diffuse scattering where its mirror-like paths do not settle the answer.

    Parameters
    ----------
    answer
        From the paths, in the array's frame.
    uplink
        The pilot, with positions in the array's frame and delays on its clock.
    lines, walls, seen_through
        The map: walls as the array sees them, where they are, and through which others.

    Returns
    -------
    The answer itself, if no wall scatters from most of its length, or if it is ``found`` and the
    diffuse field agrees. Else ``found`` where the diffuse field says, or at the one place over
    mirror-like paths that agrees with it, whichever is known better; ``ambiguous`` if the diffuse
    field, too, comes from several places alike, or contradicts paths with most of the energy.
    """
    if _settled(answer):
        return answer
    seen = [
        SeenWall(seen=Wall(start=line.start, end=line.end, covariance=line.covariance),
                 true=wall, through=through)
        for line, wall, through in zip(lines, walls, seen_through, strict=True)
    ]  # fmt: skip
    fix = search_diffuse(uplink, seen)
    if fix is None:
        return answer
    diffuse = _placed(answer, fix, seen)
    if answer.status == "found" and (len(fix.rivals) or _confirms(diffuse, answer, walls)):
        return answer
    agreeing = [one for one in (answer, *answer.alternatives) if _agree(one, diffuse)]
    if _share(answer) > MOST_ENERGY and not agreeing:
        if answer.status == "found" and not _far_apart(answer, diffuse, uplink):
            return answer
        return answer if len(fix.rivals) else _against_paths(answer, diffuse)
    if len(fix.rivals):
        if answer.status == "ambiguous":
            return answer
        return replace(
            diffuse,
            status="ambiguous",
            reason="what the wall scatters is explained as well by other places",
            alternatives=tuple(_moved(diffuse, rival) for rival in fix.rivals),
        )
    if len(agreeing) == 1:
        return _among_alike(diffuse, agreeing[0], answer)
    return _weighed(diffuse, fix, seen, answer)


def _against_paths(answer: UserEstimate, diffuse: UserEstimate) -> UserEstimate:
    """Weigh a diffuse field against paths that hold most of the energy and end elsewhere.

    One wall's scattering is right in :data:`ALONE` of all cases: so much it weighs against them.
    """
    believed = answer.probability if answer.probability is not None else UNSTATED
    odds = believed / max(1 - believed, LEAST_DOUBT) * (1 - ALONE) / ALONE
    left = odds / (1 + odds)
    if left >= CERTAIN:
        return replace(answer, probability=left)
    others = [one.probability or 0.0 for one in answer.alternatives]
    against = ALONE * (1 - left)
    share = (1 - left - against) / max(sum(others), LEAST_DOUBT)
    return replace(
        answer,
        status="ambiguous",
        reason=answer.reason or "what the wall scatters comes from elsewhere than the path does",
        probability=left,
        alternatives=(
            replace(diffuse, status="ambiguous", probability=against),
            *(
                replace(one, probability=share * chance)
                for one, chance in zip(answer.alternatives, others, strict=True)
            ),
        ),
    )


def _among_alike(diffuse: UserEstimate, agreed: UserEstimate, answer: UserEstimate) -> UserEstimate:
    """Weigh the place that the diffuse field agrees with against the other ones.

    A wall scatters what arrives at it: that shows the user's image in the mirrors beyond the wall,
    and a place behind the wall as its own image. To such places the diffuse field makes no
    difference. Others are given up; but where paths hold most of the energy (:data:`MOST_ENERGY`),
    their odds only fall by how much rarer two places agree by chance.

    Parameters
    ----------
    diffuse
        Where it says that the user is.
    agreed
        The one place over mirror-like paths that agrees.
    answer
        From the paths, with all its places.
    """
    better = agreed if _spread(agreed) < _spread(diffuse) else diffuse
    left = 0.0
    if _share(answer) > MOST_ENERGY:
        left = (1 - ALONE) / ALONE * _chance_to_agree(agreed, diffuse)
    others = [one for one in (answer, *answer.alternatives) if one is not agreed]
    weights = [
        (one.probability or 0.0) * (1.0 if _scatters_alike(one, agreed) else left) for one in others
    ]
    believed = agreed.probability or UNSTATED
    total = believed + sum(weights)
    probability = believed / total * TOGETHER
    if probability >= CERTAIN:
        return replace(
            better,
            paths=answer.paths,
            status="found",
            reason=None,
            alternatives=(),
            probability=probability,
        )
    named = [
        replace(one, status="ambiguous", reason=None, alternatives=(), probability=chance)
        for one, chance in (
            (better, probability),
            *((one, TOGETHER * w / total) for one, w in zip(others, weights, strict=True) if w > 0),
        )
    ]
    likeliest, *rest = sorted(named, key=lambda one: -(one.probability or 0.0))
    return replace(
        likeliest,
        paths=answer.paths,
        reason="the wall scatters as it would with one more mirror beyond it, or with the user "
        "behind it; or a path ends elsewhere",
        alternatives=tuple(rest),
    )


def _chance_to_agree(one: UserEstimate, other: UserEstimate) -> float:
    """Return how probable it is that an unrelated place agrees with another. [-].

    Both are on the same path length from the wall: what is left to chance is the direction, a
    quarter of a circle.
    """
    assert one.covariance is not None
    assert other.covariance is not None
    assert one.position is not None
    spread = (one.covariance + other.covariance)[:2, :2]
    width = 2 * float(np.sqrt(SAME * np.linalg.eigvalsh(spread)[-1]))
    return min(1.0, width / (0.5 * np.pi * float(np.linalg.norm(one.position))))


def _scatters_alike(one: UserEstimate, agreed: UserEstimate) -> bool:
    """Tell whether the first wall of an answer scatters the same from another place."""
    if one.path is None or agreed.path is None or not agreed.bounces:
        return False
    if one.bounces == 0:
        return one.line_of_sight is False  # straight, through the wall
    further = one.bounces is not None and one.bounces > agreed.bounces
    known = agreed.path[: agreed.bounces + 1]
    return further and bool(np.allclose(one.path[: len(known)], known, atol=SAME_BOUNCE))


def _weighed(
    diffuse: UserEstimate, fix: DiffuseFix, walls: Sequence[SeenWall], answer: UserEstimate
) -> UserEstimate:
    """Accept a position from diffuse scattering alone only if several walls support it.

    All distances from a straight wall are the same for a position and its mirror image behind the
    wall, from where the pilot may arrive around edges or through thin walls. A single wall that is
    misplaced or falsely detected gives a wrong position without a contradiction; two walls that are
    not parallel then contradict each other.
    """
    if fix.several:
        return replace(diffuse, probability=TOGETHER)
    wall = walls[fix.wall].true
    others = [one for one in (answer, *answer.alternatives) if one.position is not None]
    turn = mirrored(np.eye(3), np.zeros(3), wall.end - wall.start)
    assert diffuse.covariance is not None
    behind = replace(
        _moved(diffuse, mirrored(fix.position, wall.start, wall.end)),
        covariance=turn @ diffuse.covariance @ turn.T,
        probability=BEHIND,
    )
    left = 1 - ALONE - BEHIND
    shares = [one.probability or 1.0 for one in others]
    return replace(
        diffuse,
        status="ambiguous",
        reason="only one wall scatters the pilot: the user may be elsewhere if the wall is not "
        "quite what it seems, or behind it",
        probability=ALONE,
        alternatives=(
            behind,
            *(
                replace(
                    one,
                    status="ambiguous",
                    alternatives=(),
                    probability=left * share / (sum(shares) + 1),
                )
                for one, share in zip(others, shares, strict=True)
            ),
        ),
    )


def _settled(answer: UserEstimate) -> bool:
    """Tell whether several paths already agree, so that no diffuse search is needed."""
    return answer.status == "found" and sum(path.used for path in answer.paths) > 1


def _share(answer: UserEstimate) -> float:
    """Energy of the paths that an answer rests on, over the pilot's. [-]."""
    return float(sum(path.share for path in answer.paths if path.used))


def _far_apart(answer: UserEstimate, diffuse: UserEstimate, uplink: Uplink) -> bool:
    """Tell whether two places are beyond what errors of walls make of one and the same."""
    if answer.position is None or diffuse.position is None or answer.path_length is None:
        return True
    wavelength = speed_of_light / float(uplink.frequencies.mean())
    cell = wavelength / float(np.ptp(uplink.positions[:, 0])) * answer.path_length
    return float(np.linalg.norm(answer.position - diffuse.position)) > CELLS_APART * cell


def _spread(one: UserEstimate) -> float:
    """Largest standard deviation of a position. [m]."""
    assert one.covariance is not None
    return float(np.sqrt(np.linalg.eigvalsh(one.covariance)[-1]))


def _placed(answer: UserEstimate, fix: DiffuseFix, walls: Sequence[SeenWall]) -> UserEstimate:
    wall = walls[fix.wall]
    middle = 0.5 * (wall.true.start + wall.true.end)
    ghost = 0.5 * (wall.seen.start + wall.seen.end)
    way, _, _ = trace(
        LINEAR.towards(LINEAR.of(ghost)),
        float(np.linalg.norm(ghost)),
        [walls[index].true for index in wall.through],
    )
    return UserEstimate(
        name=answer.name,
        status="found",
        position=fix.position,
        covariance=fix.covariance + _of_the_wall(fix.position, wall.true),
        bounces=len(wall.through) + 1,
        path=np.vstack([way[:-1], middle, fix.position]),  # over the middle of the wall
        line_of_sight=False,
        paths=tuple(
            replace(path, used=False, reason="what the wall scatters comes from elsewhere")
            if path.used
            else path
            for path in answer.paths
        ),
        method="diffuse",
    )


def _of_the_wall(position: Float[np.ndarray, " 3"], wall: Wall) -> Float[np.ndarray, "3 3"]:
    """Covariance of a position that is known relative to a wall, from that of the wall."""
    lever = position - 0.5 * (wall.start + wall.end)
    turned = np.array([-lever[1], lever[0], 0.0])
    jacobian = np.stack([turned, wall.normal], axis=-1)
    covariance: np.ndarray = jacobian @ wall.covariance @ jacobian.T
    return covariance


def _confirms(diffuse: UserEstimate, answer: UserEstimate, walls: Sequence[Wall]) -> bool:
    """Tell whether a diffuse field comes from an answer, or from its image in a later mirror.

    The first wall of a path over several scatters what it receives from the user's image in the
    next one.
    """
    later = {index for path in answer.paths if path.used for index in (path.mirrors or ())[1:]}
    shown = [answer, *(_image_in(answer, walls[index]) for index in sorted(later))]
    return any(_agree(one, diffuse) for one in shown)


def _image_in(answer: UserEstimate, wall: Wall) -> UserEstimate:
    """Return an answer at the place where a wall shows it. [m]."""
    if answer.position is None or answer.covariance is None:
        return answer
    image = mirrored(answer.position, wall.start, wall.end)
    turn = mirrored(np.eye(3), np.zeros(3), wall.end - wall.start)
    # Moving a mirror moves the image twice as far.
    covariance = turn @ answer.covariance @ turn.T + 4 * _of_the_wall(image, wall)
    return replace(answer, position=image, covariance=covariance)


def _moved(answer: UserEstimate, place: Float[np.ndarray, " 3"]) -> UserEstimate:
    path = None if answer.path is None else np.vstack([answer.path[:-1], place])
    return replace(answer, status="ambiguous", position=place, path=path)


def _agree(one: UserEstimate, other: UserEstimate) -> bool:
    """Tell whether two positions are the same within their covariances."""
    if one.position is None or other.position is None:
        return False
    if one.covariance is None or other.covariance is None:
        return False
    apart = (one.position - other.position)[:2]
    spread = (one.covariance + other.covariance)[:2, :2]
    return bool(apart @ np.linalg.solve(spread, apart) < SAME)
