"""Test of line of sight for a path that seems direct: mirrors that the image does not show.

A wall too smooth for a diffuse echo shows at its two ends only, and reflects all the better; a
short one shows as a few peaks without a direction; in an echo that is nearly all noise no wall
shows. The user's pilot alone cannot distinguish the user from its image in such a mirror.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from estimator.channel.path import Wave
from estimator.geometry.bearing import Bearing
from estimator.geometry.flat_wall import FlatWall
from estimator.geometry.path_tracing import project
from estimator.geometry.specular_chains import Chain
from estimator.geometry.wall_2d import Wall
from estimator.positioning.blockage import (
    LEAST_IMAGE_CONTRAST,
    LOOSE_PEAKS,
    USER_SIZE,
    Sight,
    chance_of_blockage,
    hides_walls,
    unseen_mirrors,
    what_stands_in_the_way,
)
from estimator.positioning.edge_evidence import UNTOLD, EdgeOdds, odds_of_edges
from estimator.positioning.level_likelihood import BLOCKED
from estimator.positioning.map_context import MapContext
from estimator.positioning.unseen_mirrors import stands_straight, wall_behind, wall_between
from estimator.results.estimate import UserEstimate

LONGEST_UNSEEN = 0.5
"""Distance of two loose points beyond which they are not taken for the ends of one mirror on a leg
that the array does not look along: walls of the random rooms are up to 0.3 m long. With half and
twice of it the answers in ten rooms are the same (``python -m validation.experiments.thresholds
decisions``). [m]"""
CLOUD = 6.0
"""Distance from a known wall up to which a loose point passes for a part of the wall's echo:
sidelobes and what was scattered twice. With 3 and 12 the answers in ten rooms are the same
(``python -m validation.experiments.thresholds decisions``). [cells c/2B]"""
UNSEEN_BEYOND = (
    "beyond the wall the path passes between two points that may be the ends of another wall, too "
    "smooth to be seen"
)
EDGE_ON_BEYOND = (
    "beyond the wall the path passes behind a point that may be the near end of another wall, seen "
    "edge-on"
)


@dataclass(frozen=True, kw_only=True)
class StraightWay:
    """What the image shows on the straight line between the array and the end of a path."""

    sight: Sight
    doubt: str | None  # why something may be on it, for a person to read; None if it is clear
    otherwise: UserEstimate | None = None  # where the user is over a mirror between two points
    blocked: float = BLOCKED  # probability that something blocks the straight way to there [-]
    edges: EdgeOdds = UNTOLD  # whether such points are as bright as a mirror's ends


def look_along(
    answer: UserEstimate,
    wave: Wave,
    room: MapContext,
    how: Bearing,
    frequency: float | None = None,
) -> StraightWay:
    """Look for mirrors that the map does not show on the straight line from the array to a user.

    Parameters
    ----------
    answer
        Where the path ends, if it is direct.
    wave
        That came over it.
    room
        What the image shows.
    how
        What the array measures of a direction.
    frequency
        Centre of the band, None if unknown. [Hz]
    """
    heading, length = how.towards(wave.bearing), wave.path_length
    shown = room.shows(heading)
    sight: Sight = "clear"
    peaks = [room.unassigned_peaks]
    if not shown and room.aside is not None:
        # An image beyond the angles without grating lobes has more in it than there is, not less.
        aside = room.aside(heading, length)
        if aside is not None:
            peaks, shown, sight = [aside, *peaks], True, "clear aside"
    loose = np.concatenate([some[:LOOSE_PEAKS] for some in peaks])
    mirrors = unseen_mirrors(heading, length, loose, room.resolution, how)
    others = [_over_one_more(answer, wave, (), mirror, room, how) for mirror, _ in mirrors]
    if others:
        chances = [
            chance_of_blockage(other.position, room, how)
            for other in others
            if other.position is not None
        ]
        other, blocked = max(zip(others, chances, strict=True), key=lambda one: one[1])
        return StraightWay(
            sight="between ends",
            doubt="the straight way passes between two points that may be the ends of a wall too "
            "smooth to be seen; over such a wall the user is elsewhere",
            otherwise=other,
            blocked=blocked,
            edges=_as_edges([edges for _, edges in mirrors], room, frequency),
        )
    thing = what_stands_in_the_way(
        heading, length, np.concatenate(peaks), room.resolution.across_ray
    )
    if thing is not None:
        where = ", ".join(f"{thing[axis]:.3f}" for axis in how.coordinates)
        return StraightWay(
            sight="something on it",
            doubt=f"something stands on the straight way at ({where}) m: "
            "if it is a mirror too short to be told as one, the user is elsewhere",
        )
    if room.imaged and not room.walls and hides_walls(room.contrast):
        return StraightWay(sight="not shown", doubt=too_noisy(room.contrast))
    if length > room.reach:
        return StraightWay(
            sight="not shown",
            doubt=f"the straight way is {length:.2f} m long, and the image shows what "
            f"stands on it to {room.reach:.2f} m only; take smaller frequency steps",
        )
    if not shown:
        return StraightWay(
            sight="not shown",
            doubt=f"the image does not show what stands on the straight way at "
            f"{how.told(wave.bearing)}, but only what is within "
            f"{np.degrees(np.arcsin(room.widest)):.1f}° of boresight",
        )
    return StraightWay(sight=sight, doubt=None)


def _as_edges(
    pairs: Sequence[Float[np.ndarray, "2 3"]], room: MapContext, frequency: float | None
) -> EdgeOdds:
    """Return how much likelier pairs' levels are if one of them, any, is a mirror's edges."""
    if room.levels is None or frequency is None:
        return UNTOLD
    levels = room.levels(np.concatenate(pairs)).reshape(-1, 2)
    odds = [
        odds_of_edges(edges, level, frequency) for edges, level in zip(pairs, levels, strict=True)
    ]
    return EdgeOdds(
        metal=float(np.mean([one.metal for one in odds])),
        lossy=float(np.mean([one.lossy for one in odds])),
    )


def look_along_legs(
    answer: UserEstimate,
    wave: Wave,
    chain: Chain,
    room: MapContext,
    how: Bearing,
    frequency: float | None = None,
) -> StraightWay:
    """Look for mirrors that cross a path beyond its first mirror, and that the map does not show.

    Parameters
    ----------
    answer
        Where the path ends, over the mirrors that are known.
    wave
        That came over it.
    chain
        Its mirrors, from the array outward.
    room, how, frequency
        As in :func:`look_along`.
    """
    points = room.unassigned_peaks[:LOOSE_PEAKS]
    if answer.path is None:
        return StraightWay(sight="clear", doubt=None)
    between: list[tuple[FlatWall, Float[np.ndarray, "2 3"]]] = []
    for first, second in zip(*np.triu_indices(len(points), k=1), strict=True):
        wall: FlatWall | None = wall_between(points[first], points[second], room.resolution, how)
        if wall is None or not stands_straight(wall):
            continue
        if np.linalg.norm(points[first] - points[second]) > LONGEST_UNSEEN:
            continue
        if _crosses(wall, answer.path):
            between.append((wall, points[[first, second]]))
    if between:
        return StraightWay(
            sight="between ends",
            doubt=UNSEEN_BEYOND,
            otherwise=_over_one_more(answer, wave, chain, between[0][0], room, how),
            edges=_as_edges([edges for _, edges in between], room, frequency),
        )
    # A single edge tells the wall behind it where all edges are upright: in the plane.
    for point in points if len(how.coordinates) == 2 else ():
        if _beside_a_wall(point, room):
            continue
        wall = wall_behind(point, room.resolution)
        if _crosses(wall, answer.path):
            return StraightWay(
                sight="behind a point",
                doubt=EDGE_ON_BEYOND,
                otherwise=_over_one_more(answer, wave, chain, wall, room, how),
            )
    return StraightWay(sight="clear", doubt=None)


def _beside_a_wall(point: Float[np.ndarray, " 3"], room: MapContext) -> bool:
    """Tell whether a point is so near to a known wall that it may be a sidelobe of the wall's."""
    for wall in room.walls:
        assert isinstance(wall, Wall)
        along = wall.end - wall.start
        share = np.clip((point - wall.start) @ along / (along @ along), 0.0, 1.0)
        apart = float(np.linalg.norm(point - wall.start - share * along))
        if apart < CLOUD * room.resolution.along_ray:
            return True
    return False


def _crosses(wall: FlatWall, path: Float[np.ndarray, "vertices 3"]) -> bool:
    """Tell whether a wall crosses a path beyond its first mirror, clear of its ends."""
    for start, end in pairwise(path[1:]):
        far = float(np.linalg.norm(end - start))
        hit = wall.hit(start, (end - start) / far)
        if hit is not None and USER_SIZE < hit[0] < far - USER_SIZE:
            return True
    return False


def _over_one_more(
    answer: UserEstimate,
    wave: Wave,
    chain: Chain,
    wall: FlatWall,
    room: MapContext,
    how: Bearing,
) -> UserEstimate:
    """Return where the user is if one more wall reflects the path."""
    known = [room.walls[index] for index in dict.fromkeys(chain)]
    place = project(how, wave.bearing, wave.path_length, [*known, wall], covariance=wave.covariance)
    return replace(
        answer,
        status="ambiguous",
        position=place.position,
        covariance=place.covariance,
        bounces=len(place.walls),
        path=place.path,
        line_of_sight=False,
    )


def too_noisy(contrast: float) -> str:
    """Return a message: the echo is too noisy for the image to exclude a wall."""
    return (
        f"the brightest point of the echo's image is {10 * np.log10(max(contrast, 1.0)):.0f} dB "
        f"above its noise, and below {10 * np.log10(LEAST_IMAGE_CONTRAST):.0f} dB walls may not "
        "show: over one the user is elsewhere; measure with less noise, or average more"
    )
