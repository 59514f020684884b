"""From a user's paths and the walls to a position, or to the reason why there is none."""

from dataclasses import replace

from estimator.channel.path import PathSet
from estimator.positioning.known_clock import on_our_clock
from estimator.positioning.map_context import MapContext
from estimator.positioning.several_rooms import over_several_rooms
from estimator.positioning.unknown_clock import on_any_clock
from estimator.results.estimate import UserEstimate


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
    rule = on_our_clock if clock_known else on_any_clock
    if room.rooms:
        answers = [
            (chance, rule(name, found, replace(room, walls=walls, rooms=())))
            for chance, walls in room.rooms
        ]
        answer = over_several_rooms(answers, how=found.how)
    else:
        answer = rule(name, found, room)
    if answer.status == "found" and not room.imaged:
        reason = "no echo was measured, so mirrors are unknown; this is the place without any"
        answer = replace(answer, status="ambiguous", reason=reason, line_of_sight=None)
    return answer
