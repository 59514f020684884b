r"""A moving user's track from the positions of single measurements, by multiple hypotheses.

The motion is that of :mod:`estimator.tracking.constant_velocity`: filtered forward, smoothed back.

Which fix to believe: of each measurement at most one candidate is the user, the answer or one of
its alternatives, if the track predicts it within a χ² gate; else it is an outlier. Sequences of
such choices compete by their probability [1]_: also the first fix may be the wrong one.

References
----------
.. [1] Reid, "An algorithm for tracking multiple targets", IEEE Trans. Automatic Control 24(6),
   1979.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from estimator import false_alarm
from estimator.compute.distributions import chi_square_quantile
from estimator.results.estimate import UserEstimate
from estimator.tracking.constant_velocity import State, acceleration_noise, moved, smoothed, updated

ACCELERATION = 0.5
"""Spectral density of the acceleration of somebody who walks: twice the variance of 0.5 m/s²,
over the second that it lasts. [m²/s³]"""
SPEED = 1.5
"""Standard deviation of each coordinate of the velocity before anything is known of it. [m/s]"""
GATE = 1 - false_alarm.DISAGREEMENT
"""Probability with which the true fix is inside the gate. [-]"""
OUTLIER_SHARE = 0.05
"""Prior probability that a fix is none of the user's: above the share of wrong answers that the
trap rooms show, so that one outlier does not win against a track. [-]"""
REGION = 10.0
"""Side of the square or cube over which outliers, and users at first, are spread: a large room. It
enters as its logarithm. [m]"""
MOST_CHOICES = 16
"""Hypotheses that are followed at once: four ambiguous fixes in a row with two candidates each. [-]
"""
LEAST_SHARE = 1e-9
"""Probability over the best hypothesis' below which one is given up. [-]"""
IN_PLANE = 1e-6
"""Distance across a plane by which fixes of the plane may differ: rounding. [m]"""
FLAT = 1e-9
"""Variance over the largest one below which a direction is known by assumption: a linear array
locates in its own plane. [-]"""


@dataclass(frozen=True, kw_only=True)
class Fix:
    """What one measurement says of a user; without candidates: nothing was found."""

    time: float  # [s]
    positions: Float[np.ndarray, "candidates 3"]  # the answer first, then its alternatives [m]
    covariances: Float[np.ndarray, "candidates 3 3"]  # [m²]


@dataclass(frozen=True, kw_only=True)
class TrackPoint:
    """The user at one time."""

    time: float  # [s]
    position: Float[np.ndarray, " 3"]  # [m]
    velocity: Float[np.ndarray, " 3"]  # [m/s]
    covariance: Float[np.ndarray, "6 6"]  # of (position, velocity)
    candidate: int | None  # which of the fix is the user: 0 the answer; None: none is


@dataclass(frozen=True, kw_only=True)
class Track:
    """A user's motion: one point for each fix, from the first that is believed on."""

    points: tuple[TrackPoint, ...]  # smoothed: each one knows all fixes
    filtered: tuple[TrackPoint, ...]  # each one knows the fixes up to its own
    acceleration: float  # spectral density, of the motion model [m²/s³]
    rival: float  # probability of the second best sequence of choices over the best's [-]


def fix(time: float, user: UserEstimate) -> Fix:
    """Make a fix of an answer; an ambiguous one brings its alternatives.

    Parameters
    ----------
    time
        Of the measurement. [s]
    user
        The answer; its frame is that of the track.
    """
    known = [
        (answer.position, answer.covariance)
        for answer in (user, *user.alternatives)
        if answer.position is not None and answer.covariance is not None
    ]
    return Fix(
        time=time,
        positions=np.array([position for position, _ in known]).reshape(-1, 3),
        covariances=np.array([covariance for _, covariance in known]).reshape(-1, 3, 3),
    )


def track(
    fixes: Sequence[Fix],
    *,
    acceleration: float = ACCELERATION,
    speed: float = SPEED,
    outlier_share: float = OUTLIER_SHARE,
    gate: float = GATE,
    region: float = REGION,
    common: Float[np.ndarray, "3 3"] | None = None,
) -> Track:
    """Follow one user through its fixes.

    Parameters
    ----------
    fixes
        In the order of time; several seconds may lie between two.
    acceleration
        Spectral density of the acceleration. [m²/s³]
    speed
        Standard deviation of each coordinate of the velocity at first. [m/s]
    outlier_share
        Probability that a fix is no candidate's.
    gate
        Probability with which the true fix is inside its gate.
    region
        Extent over which outliers are spread. [m]
    common
        Part of every fix's covariance that is one and the same error in all, such as a wall's:
        it does not average out. None: all errors are independent. [m²]

    Returns
    -------
    The track; without points if no fix has a candidate.

    Raises
    ------
    ValueError
        If times do not increase, a parameter is out of its range, or the common covariance
        exceeds a fix's.
    """
    _check(fixes, acceleration, speed, outlier_share, gate, region)
    axes = _free_axes(fixes)
    steady = np.zeros((3, 3)) if common is None else common
    seen = [_seen(one, axes, steady) for one in fixes]
    size = len(axes)
    rules = _Rules(
        gate=chi_square_quantile(gate, max(size, 1)),
        missed=float(np.log(outlier_share) - size * np.log(region)),
        believed=float(np.log1p(-outlier_share)),
        start=float(-size * np.log(region)),
        speed=speed,
        acceleration=acceleration,
    )
    choices = [_Choice(score=0.0, states=(), candidates=())]
    for index, one in enumerate(seen):
        gap = one.time - seen[index - 1].time if index else 0.0
        grown = [after for choice in choices for after in _grown(choice, one, gap, rules)]
        grown.sort(key=lambda choice: -choice.score)
        least = grown[0].score + np.log(LEAST_SHARE)
        choices = [choice for choice in grown if choice.score >= least][:MOST_CHOICES]
    best = choices[0]
    first = next((at for at, chosen in enumerate(best.candidates) if chosen is not None), None)
    if first is None:
        return Track(points=(), filtered=(), acceleration=acceleration, rival=0.0)
    states = [state for state in best.states if state is not None]
    times = [one.time for one in seen[first:]]
    place = _Placing(axes=axes, origin=_off_plane(fixes, axes), common=steady)
    chosen = best.candidates[first:]
    return Track(
        points=_points(times, smoothed(states, times, acceleration), chosen, place),
        filtered=_points(times, states, chosen, place),
        acceleration=acceleration,
        rival=float(np.exp(choices[1].score - best.score)) if len(choices) > 1 else 0.0,
    )


def predicted(found: Track, time: float) -> TrackPoint:
    """Tell where the user will be after the last fix.

    Parameters
    ----------
    found
        Its track.
    time
        Not before the track's end. [s]

    Raises
    ------
    ValueError
        If the track is empty or the time lies before its end.
    """
    if not found.points:
        raise ValueError("the track is empty; no fix of it was believed")
    last = found.filtered[-1]
    if time < last.time:
        raise ValueError(f"time {time:g} s is before the track's end at {last.time:g} s")
    gap = time - last.time
    position = last.position + gap * last.velocity
    # Along the plane of the fixes only: elsewhere the velocity is 0 by assumption.
    spread = last.covariance[3:, 3:]
    values, vectors = np.linalg.eigh(spread)
    free = vectors[:, values > FLAT * values[-1]]
    plane = free @ free.T
    forward = np.kron(np.array([[1.0, gap], [0.0, 1.0]]), np.eye(3))
    noise = np.kron(acceleration_noise(gap, found.acceleration), plane)
    return replace(
        last,
        time=time,
        position=position,
        covariance=forward @ last.covariance @ forward.T + noise,
        candidate=None,
    )


@dataclass(frozen=True, kw_only=True)
class _Rules:
    gate: float  # squared normalised distance [-]
    missed: float  # log density of an outlier
    believed: float  # log probability of a fix that is none
    start: float  # log density of the user before the first fix
    speed: float
    acceleration: float


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """A fix along the free axes."""

    time: float
    positions: Float[np.ndarray, "candidates free"]
    covariances: Float[np.ndarray, "candidates free free"]


@dataclass(frozen=True, kw_only=True)
class _Choice:
    """One sequence of candidates and the filter that believes them."""

    score: float  # log probability
    states: tuple[State | None, ...]  # after each fix; None before the first believed one
    candidates: tuple[int | None, ...]


@dataclass(frozen=True, kw_only=True)
class _Placing:
    axes: Float[np.ndarray, "free 3"]
    origin: Float[np.ndarray, " 3"]
    common: Float[np.ndarray, "3 3"]


def _check(
    fixes: Sequence[Fix],
    acceleration: float,
    speed: float,
    outlier_share: float,
    gate: float,
    region: float,
) -> None:
    times = [one.time for one in fixes]
    for before, after in pairwise(times):
        if not after > before:
            raise ValueError(f"fixes at {before:g} s, then {after:g} s; give them in order of time")
    for name, value in (("acceleration", acceleration), ("speed", speed), ("region", region)):
        if not value > 0:
            raise ValueError(f"{name} = {value:g}; it must be above 0")
    for name, value in (("outlier_share", outlier_share), ("gate", gate)):
        if not 0 < value < 1:
            raise ValueError(f"{name} = {value:g}; it must lie between 0 and 1")


def _free_axes(fixes: Sequence[Fix]) -> Float[np.ndarray, "free 3"]:
    """Return the directions in which positions are uncertain; the others are assumed."""
    together = np.concatenate([np.zeros((1, 3, 3)), *(one.covariances for one in fixes)]).sum(0)
    values, vectors = np.linalg.eigh(together)
    axes: np.ndarray = vectors.T[values > FLAT * max(float(values[-1]), np.finfo(float).tiny)]
    return axes


def _off_plane(fixes: Sequence[Fix], axes: Float[np.ndarray, "free 3"]) -> Float[np.ndarray, " 3"]:
    """Return what all positions have in common across the free axes. [m]."""
    places = np.concatenate([one.positions for one in fixes])
    across = places - places @ axes.T @ axes
    worst = float(np.abs(across - across[0]).max())
    if worst > IN_PLANE:
        raise ValueError(
            f"positions differ by {worst:.3g} m in a direction in which their covariances are 0; "
            "give fixes of one plane, or covariances of all three coordinates"
        )
    return np.asarray(across[0])


def _seen(one: Fix, axes: Float[np.ndarray, "free 3"], common: Float[np.ndarray, "3 3"]) -> _Seen:
    """Express a fix along the free axes, without the error that all share."""
    spread = axes @ (one.covariances - common) @ axes.T
    for index, own in enumerate(spread):
        if np.linalg.eigvalsh(own).min() <= 0:
            raise ValueError(
                f"fix at {one.time:g} s, candidate {index}: its covariance is not above the "
                "common one; the common part is what is the same in all fixes"
            )
    return _Seen(time=one.time, positions=one.positions @ axes.T, covariances=spread)


def _grown(choice: _Choice, one: _Seen, gap: float, rules: _Rules) -> list[_Choice]:
    """Continue a sequence by each candidate inside the gate, and by none."""
    before = choice.states[-1] if choice.states else None
    here = None if before is None else moved(before, gap, rules.acceleration)
    # A fix without candidates says nothing, for or against.
    missed = rules.missed if len(one.positions) else 0.0
    grown = [_with(choice, here, None, missed)]
    believed = rules.believed - np.log(max(len(one.positions), 1))
    for index, (place, spread) in enumerate(zip(one.positions, one.covariances, strict=True)):
        size = place.size
        if here is None:
            velocity = rules.speed**2 * np.eye(size)
            start = State(
                mean=np.concatenate([place, np.zeros(size)]),
                covariance=np.block(
                    [[spread, np.zeros((size, size))], [np.zeros((size, size)), velocity]]
                ),
            )
            grown.append(_with(choice, start, index, believed + rules.start))
            continue
        after = updated(here, place, spread)
        if after.distance <= rules.gate:
            grown.append(_with(choice, after.state, index, believed + after.log_density))
    return grown


def _with(choice: _Choice, state: State | None, candidate: int | None, more: float) -> _Choice:
    return _Choice(
        score=choice.score + more,
        states=(*choice.states, state),
        candidates=(*choice.candidates, candidate),
    )


def _points(
    times: Sequence[float],
    states: Sequence[State],
    candidates: Sequence[int | None],
    place: _Placing,
) -> tuple[TrackPoint, ...]:
    points = []
    size = len(place.axes)
    wide = np.kron(np.eye(2), place.axes)
    for time, state, candidate in zip(times, states, candidates, strict=True):
        covariance = wide.T @ state.covariance @ wide
        covariance[:3, :3] += place.common
        points.append(
            TrackPoint(
                time=time,
                position=place.origin + state.mean[:size] @ place.axes,
                velocity=state.mean[size:] @ place.axes,
                covariance=covariance,
                candidate=candidate,
            )
        )
    return tuple(points)
