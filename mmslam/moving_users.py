"""Moving users: position estimates of successive measurements, joined to one track per user."""

from collections.abc import Sequence
from dataclasses import dataclass

from estimator.results.estimate import UserEstimate
from estimator.tracking.multi_hypothesis import ACCELERATION, Track, fix, track


@dataclass(frozen=True, kw_only=True)
class MovingUser:
    """One user's position estimates at all times, and the track through them."""

    name: str
    times: tuple[float, ...]  # [s]
    answers: tuple[UserEstimate, ...]  # one for each time
    track: Track


def track_answers(
    times: Sequence[float],
    found: Sequence[dict[str, UserEstimate]],
    *,
    acceleration: float = ACCELERATION,
) -> tuple[MovingUser, ...]:
    """Track every user through the answers of successive measurements.

    Parameters
    ----------
    times
        Of the measurements. [s]
    found
        The answers at each of them, by the user's name.
    acceleration
        Spectral density, of the motion model. [m²/s³]
    """
    users = []
    for name in dict.fromkeys(name for answers in found for name in answers):
        missing = UserEstimate(name=name, status="not_found", reason="no pilot at this time")
        answers = tuple(at_one_time.get(name, missing) for at_one_time in found)
        fixes = [fix(time, answer) for time, answer in zip(times, answers, strict=True)]
        way = track(fixes, acceleration=acceleration)
        users.append(MovingUser(name=name, times=tuple(times), answers=answers, track=way))
    return tuple(users)
