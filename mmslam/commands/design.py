"""The figures of a radio's design, from a scenario's radio and array or from options."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from scenes.scenario import Scenario, ScenarioError
from validation.design.design_table import DesignRow, design_table


def design_rows(
    *,
    start_ghz: float,
    stop_ghz: float,
    points: int,
    elements: int,
    spacing_mm: float,
    distance_m: float,
    angle_deg: float,
) -> tuple[DesignRow, ...]:
    """Work out resolutions, unambiguous ranges, steps and field regions.

    Raises
    ------
    MeasurementError
        If a value is impossible.
    """
    return design_table(
        start=start_ghz * 1e9,
        stop=stop_ghz * 1e9,
        points=points,
        aperture_length=(elements - 1) * spacing_mm * 1e-3,
        elements=elements,
        distance=distance_m,
        angle=float(np.radians(angle_deg)),
    )


def scenario_radio(scenario: Scenario) -> dict[str, Any]:
    """Return the options of :func:`design_rows` that a scenario gives (along the array's axis).

    Raises
    ------
    ScenarioError
        If its base station is no array.
    """
    station = scenario.base_station
    if station.receivers is not None:
        raise ScenarioError(
            f"scenario {scenario.name!r}: base_station.receivers stand by themselves; a design "
            "is worked out for an array of elements: choose another scenario"
        )
    spacing = station.spacing_mm
    return {
        "start_ghz": scenario.radio.start_ghz,
        "stop_ghz": scenario.radio.stop_ghz,
        "points": scenario.radio.points,
        "elements": station.shape[0],
        "spacing_mm": spacing[0] if isinstance(spacing, tuple) else spacing,
    }


def design_document(options: Mapping[str, Any], rows: tuple[DesignRow, ...]) -> dict[str, Any]:
    """Lay options and rows out for JSON."""
    return {"options": dict(options), "rows": [asdict(row) for row in rows]}


def design_lines(rows: tuple[DesignRow, ...]) -> list[str]:
    """Format rows as an aligned table."""
    values = [row.value if isinstance(row.value, str) else f"{row.value:.4g}" for row in rows]
    name_width = max(len(row.name) for row in rows)
    value_width = max(len(f"{value} {row.unit}") for value, row in zip(values, rows, strict=True))
    return [
        f"{row.name:<{name_width}}  {f'{value} {row.unit}':<{value_width}}  {row.note}".rstrip()
        for value, row in zip(values, rows, strict=True)
    ]
