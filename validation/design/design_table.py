"""Resolutions and limits of a radio, aperture and distance, in the units of radar engineering."""

from dataclasses import dataclass

import numpy as np
from scipy.constants import speed_of_light

from estimator.array.field_regions import (
    curvature,
    far_field_distance,
    field_region,
    fresnel_distance,
)
from estimator.array.resolution import (
    cross_range_resolution,
    largest_frequency_step,
    largest_spacing,
    range_resolution,
    unaliased_sine,
    unambiguous_range,
)
from estimator.measurement.model import MeasurementError


@dataclass(frozen=True, kw_only=True)
class DesignRow:
    """One line of the table."""

    name: str
    value: float | str
    unit: str
    note: str = ""


def design_table(
    *,
    start: float,
    stop: float,
    points: int,
    aperture_length: float,
    elements: int,
    distance: float,
    angle: float = 0.0,
) -> tuple[DesignRow, ...]:
    """Compute the figures of a radio's design.

    Parameters
    ----------
    start, stop
        Band. [Hz]
    points
        Frequencies in it.
    aperture_length
        From the first to the last element. [m]
    elements
        Positions of the linear aperture.
    distance
        Of target and user. [m]
    angle
        Largest angle of targets and users off broadside. [rad]

    Raises
    ------
    MeasurementError
        If a value is impossible.
    """
    if not 0 < start < stop:
        raise MeasurementError(
            f"band {start:g} … {stop:g} Hz; the start must be positive and below the stop"
        )
    for name, count in (("points", points), ("elements", elements)):
        if count < 2:
            raise MeasurementError(f"{name} is {count}; it must be at least 2")
    bandwidth, centre = stop - start, (start + stop) / 2
    step = bandwidth / (points - 1)
    spacing = aperture_length / (elements - 1)
    middle, shortest = speed_of_light / centre, speed_of_light / stop
    length = elements * spacing  # each element represents one spacing

    def degrees(sine: float) -> float:
        return float(np.degrees(np.arcsin(sine)))

    def across(passes: int) -> float:
        return cross_range_resolution(
            wavelength=middle,
            distance=distance,
            aperture_length=length,
            angle=angle,
            passes=passes,
        )

    def ok(good: bool, otherwise: str) -> str:
        return "" if good else otherwise

    echo_range, path = unambiguous_range(step), unambiguous_range(step, passes=1)
    return (
        DesignRow(name="bandwidth", value=bandwidth / 1e9, unit="GHz"),
        DesignRow(name="wavelength at the centre", value=middle * 1e3, unit="mm"),
        DesignRow(name="frequency step", value=step / 1e6, unit="MHz"),
        DesignRow(name="element spacing", value=spacing * 1e3, unit="mm"),
        DesignRow(
            name="range cell, echo",
            value=range_resolution(bandwidth) * 1e3,
            unit="mm",
            note=f"-3 dB; c/2B is {speed_of_light / (2 * bandwidth) * 1e3:.3g} mm",
        ),
        DesignRow(
            name="range cell, uplink path",
            value=range_resolution(bandwidth, passes=1) * 1e3,
            unit="mm",
        ),
        DesignRow(
            name="cross-range cell, echo",
            value=across(2) * 1e3,
            unit="mm",
            note=f"at {distance:g} m",
        ),
        DesignRow(
            name="cross-range cell, uplink",
            value=across(1) * 1e3,
            unit="mm",
            note=f"at {distance:g} m",
        ),
        DesignRow(
            name="beam width, uplink",
            value=float(np.degrees(across(1) / distance)),
            unit="°",
        ),
        DesignRow(
            name="unambiguous range, echo",
            value=echo_range,
            unit="m",
            note=ok(distance < echo_range, f"too short for {distance:g} m"),
        ),
        DesignRow(
            name="unambiguous path, uplink",
            value=path,
            unit="m",
            note=ok(distance < path, f"too short for {distance:g} m"),
        ),
        DesignRow(
            name="largest frequency step",
            value=largest_frequency_step(distance) / 1e6,
            unit="MHz",
            note=f"for echoes from {distance:g} m",
        ),
        DesignRow(
            name="unambiguous angle, echo",
            value=degrees(unaliased_sine(spacing, shortest)),
            unit="° off broadside",
            note=ok(
                unaliased_sine(spacing, shortest) >= abs(float(np.sin(angle))),
                f"too narrow for {np.degrees(angle):g}°",
            ),
        ),
        DesignRow(
            name="unambiguous angle, uplink",
            value=degrees(unaliased_sine(spacing, shortest, passes=1)),
            unit="° off broadside",
        ),
        DesignRow(
            name="spacing for all angles, echo",
            value=largest_spacing(shortest) * 1e3,
            unit="mm",
            note="λ/4 at the highest frequency",
        ),
        DesignRow(name="Fresnel distance", value=fresnel_distance(length, shortest), unit="m"),
        DesignRow(name="far field from", value=far_field_distance(length, shortest), unit="m"),
        DesignRow(
            name=f"at {distance:g} m",
            value=field_region(distance, length, shortest),
            unit="",
            note="a plane-wave model errs by "
            f"{np.degrees(curvature(distance, length, shortest)):.3g}° of phase",
        ),
    )
