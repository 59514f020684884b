r"""The medium that waves run in: one door for it, in place of every wavenumber.

Waves of frequency f in a medium of index n run as those of :math:`n f` in vacuum: with
:math:`k = 2 \pi n f / c` every length comes out in metres of that medium. Times scale the other
way: a clock offset or a listed delay τ is :math:`\tau / n` at those frequencies.
"""

from collections.abc import Iterable
from dataclasses import replace

from estimator.measurement.air import ROOM, Air
from estimator.measurement.model import Measurement
from estimator.results.estimate import UserEstimate

UNSURE_KELVIN = 10.0
"""Error of a temperature that a note is about: nobody looked at a thermometer. [K]"""

UNSURE_HUMIDITY = 50.0
"""Error of a relative humidity that a note is about: it was not measured. [%]"""


def as_in_vacuum(measurement: Measurement) -> Measurement:
    """Return the measurement that has the same lengths in vacuum; itself, if it is of vacuum."""
    index = measurement.refractive_index
    if index == 1.0:
        return measurement
    echo, offset = measurement.echo, measurement.clock_offset
    return replace(
        measurement,
        echo=None if echo is None else replace(echo, frequencies=echo.frequencies * index),
        uplinks=tuple(
            replace(one, frequencies=one.frequencies * index) for one in measurement.uplinks
        ),
        path_lists=tuple(
            replace(
                one,
                delay=one.delay / index,
                delay_deviation=one.delay_deviation / index,
                frequency=None if one.frequency is None else one.frequency * index,
            )
            for one in measurement.path_lists
        ),
        clock_offset=None if offset is None else offset / index,
        air=None,
        medium_index=None,
    )


def with_true_times(user: UserEstimate, index: float) -> UserEstimate:
    """Return a user of :func:`as_in_vacuum` with its clock offset in seconds."""
    if index == 1.0 or user.clock_offset is None:
        return user
    spread = user.clock_deviation
    return replace(
        user,
        clock_offset=user.clock_offset * index,
        clock_deviation=None if spread is None else spread * index,
        alternatives=tuple(with_true_times(other, index) for other in user.alternatives),
    )


def medium_notes(measurement: Measurement, users: Iterable[UserEstimate]) -> tuple[str, ...]:
    """Say in what medium lengths were measured, and what not knowing it better does to them.

    A measurement without air that bears a seed was simulated in vacuum: nothing is said of it.

    Parameters
    ----------
    measurement
        As it was given.
    users
        Whose paths a length's error is given of.
    """
    farthest = max((user.path_length or 0.0 for user in users), default=0.0)
    if measurement.medium_index is not None:
        return (f"lengths are those in a medium of index {measurement.medium_index:g}",)
    air = measurement.air
    if air is not None:
        warmer = abs(_changed(air, kelvin=UNSURE_KELVIN))
        wetter = abs(_changed(air, humidity=UNSURE_HUMIDITY))
        return (
            f"lengths are those in air of {air}: {air.refractivity:.0f} ppm shorter than in "
            f"vacuum; {UNSURE_KELVIN:g} K more would change them by "
            f"{_ppm(warmer, farthest)}, {UNSURE_HUMIDITY:g} % of humidity by "
            f"{_ppm(wetter, farthest)}",
        )
    if measurement.seed is not None:
        return ()
    return (
        "the medium is not told, so lengths are those in vacuum; in air of "
        f"{ROOM} they would be {_ppm(ROOM.refractivity, farthest)} shorter: tell the air",
    )


def _ppm(change: float, length: float) -> str:
    of_path = f" ({1e-3 * change * length:.3f} mm of {length:.2f} m)" if length > 0 else ""
    return f"{change:.0f} ppm{of_path}"


def _changed(air: Air, *, kelvin: float = 0.0, humidity: float = 0.0) -> float:
    """Return the larger change of refractivity by one step up or down. [ppm]."""
    steps = [
        Air(
            temperature_c=min(max(air.temperature_c + sign * kelvin, -80.0), 100.0),
            pressure_hpa=air.pressure_hpa,
            humidity_percent=min(max(air.humidity_percent + sign * humidity, 0.0), 100.0),
        ).refractivity
        - air.refractivity
        for sign in (-1, 1)
    ]
    return max(steps, key=abs)
