"""What a contradiction in the data does to an answer: it widens its covariance, or leaves it open.

A delay against a curvature, in the pilot and in the echo: what disagrees by more than
:data:`WIDENS` deviations is added to the covariance in all directions (a delay moves the place
along its ray, a scale of the positions across it, by no more). From :data:`OPENS` deviations on,
and beyond a cell of the range resolution, the answer is ambiguous: then another arrival, another
place over the walls, may be the true one. Within a cell it is what calibration leaves.
"""

from dataclasses import dataclass, replace
from typing import Literal

from scipy.constants import speed_of_light

from estimator.geometry.lateness import Lateness
from estimator.results.estimate import Check, UserEstimate

WIDENS = 3.3
"""Deviations from which a disagreement widens the covariance: of Gaussian errors one in 1000 is as
large. [-]"""
OPENS = 5.0
"""Deviations from which it may leave the answer open: one in 1.7 million. [-]"""


@dataclass(frozen=True, kw_only=True)
class Doubted:
    """An answer after its data were compared, and what was compared."""

    user: UserEstimate
    checks: tuple[Check, ...]


def doubted(
    user: UserEstimate,
    *,
    pilot: Lateness | None,
    echo: Lateness | None,
    height_error: float,
    bandwidth: float,
    axes: list[int],
) -> Doubted:
    """Hold an answer's delays against curvatures.

    Parameters
    ----------
    user
        As the paths and the map have it.
    pilot, echo
        By how much the waves it rests on, and the walls' echoes, are later than they are curved;
        None where nothing tells. The echo's counts for answers over walls only.
    height_error
        By how much lengths differ as the pilot's elements are off the array's plane. [m]
    bandwidth
        Of both. [Hz]
    axes
        Coordinates that were solved for.

    Returns
    -------
    The answer, and each comparison.
    """
    if user.position is None or user.covariance is None:
        return Doubted(user=user, checks=())
    cell = speed_of_light / bandwidth
    used = [len(path.mirrors or ()) for path in user.paths if path.used]
    bounces = max(used, default=user.bounces or 0)
    checks, reasons, extra = [], [], height_error**2
    if height_error > cell:
        reasons.append(
            f"the pilot's elements stand off the plane of the echo's array, which makes lengths "
            f"differ by {1e3 * height_error:.3g} mm; a linear array's answer lies in one plane"
        )
    both: tuple[tuple[Literal["echo", "pilot"], Lateness | None, float, float], ...] = (
        ("pilot", pilot, 1.0, cell),
        ("echo", echo, 2.0 * bounces, cell / 2),
    )
    for name, late, reach, limit in both:
        if late is None or not reach:
            continue
        text = told(name, late, two_way=name == "echo")
        widens = late.deviations > WIDENS
        checks.append(
            Check(
                user=user.name, data=name, shift=late.shift, deviation=late.deviation,
                agrees=not widens, text=text,
            )
        )  # fmt: skip
        if widens:
            extra += (reach * late.shift) ** 2
        if late.deviations > OPENS and abs(late.shift) > limit:
            reasons.append(text)
    if extra:
        covariance = user.covariance.copy()
        covariance[axes, axes] += extra
        user = replace(user, covariance=covariance)
    if reasons and user.status == "found":
        user = replace(user, status="ambiguous", reason="; ".join(reasons))
    return Doubted(user=user, checks=tuple(checks))


def told(name: str, late: Lateness, *, two_way: bool) -> str:
    """Say what was compared, and which values would mend a disagreement."""
    ways = 2 if two_way else 1
    delay, deviation = (
        1e9 * ways * value / speed_of_light for value in (late.shift, late.deviation)
    )
    if late.deviations <= WIDENS:
        return (
            f"the {name}'s delays agree with its curvature: no cable beyond "
            f"{abs(delay) + WIDENS * deviation:.2g} ns is left in it"
        )
    # A scale s of the positions makes curvatures smaller by s².
    scale = -0.5 * late.shift / late.distance
    more = "far apart" if scale > 0 else "near together"
    word = "too late" if late.shift > 0 else "too early"
    return (
        f"the {name} is {1e3 * abs(late.shift):.3g} ± {1e3 * late.deviation:.2g} mm {word} for its "
        f"curvature: a cable of {delay:.3g} ± {deviation:.1g} ns left in it would mend that, or "
        f"positions stated {100 * abs(scale):.2g} % too {more}"
    )
