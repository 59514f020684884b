"""The figures of a radio's design, from a scenario's radio and array or from options."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mmslam.table import Table, html
from scenes.files.loading import load_scenario
from scenes.scenario import Scenario, ScenarioError
from validation.design.design_table import DesignRow, design_table


@dataclass(frozen=True, kw_only=True, repr=False)
class Design:
    """Resolutions, unambiguous ranges and field regions of a radio and an array at a distance."""

    options: Mapping[str, Any]  # the arguments of :func:`design`
    rows: tuple[DesignRow, ...]

    def __getitem__(self, name: str) -> DesignRow:
        """Return a figure by its name.

        Raises
        ------
        KeyError
            If there is none of this name.
        """
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(f"no {name!r}; there are {', '.join(row.name for row in self.rows)}")

    def to_dict(self) -> dict[str, Any]:
        """Return options and rows as one document."""
        return {"options": dict(self.options), "rows": [asdict(row) for row in self.rows]}

    def __repr__(self) -> str:
        """Show an aligned table."""
        return "\n".join(design_lines(self.rows))

    def _repr_html_(self) -> str:
        rows = [(row.name, f"{_value(row)} {row.unit}", row.note) for row in self.rows]
        return html([Table(rows=rows)])


def design(
    scenario: str | Scenario = "slam_2d",
    *,
    start_ghz: float | None = None,
    stop_ghz: float | None = None,
    points: int | None = None,
    elements: int | None = None,
    spacing_mm: float | None = None,
    distance_m: float = 1.0,
    angle_deg: float = 0.0,
) -> Design:
    """Work out resolutions, unambiguous ranges, needed steps and field regions of a radio.

    Parameters
    ----------
    scenario
        Scenario whose radio and array (along its axis) supply the values that are not given.
    start_ghz, stop_ghz, points
        The band, and the frequencies in it.
    elements, spacing_mm
        Of the linear array.
    distance_m, angle_deg
        Distance of target and user [m], and their largest angle off broadside [degree].

    Raises
    ------
    MeasurementError
        If a value is impossible.
    ScenarioError
        If there is no such scenario, or its base station is no array.

    Examples
    --------
    >>> import mmslam
    >>> design = mmslam.design(start_ghz=220.0, stop_ghz=330.0, distance_m=1.8)
    >>> round(design["bandwidth"].value), design["bandwidth"].unit
    (110, 'GHz')
    """
    loaded = load_scenario(scenario) if isinstance(scenario, str) else scenario
    given = {
        "start_ghz": start_ghz,
        "stop_ghz": stop_ghz,
        "points": points,
        "elements": elements,
        "spacing_mm": spacing_mm,
    }
    options = _radio(loaded)
    options |= {key: value for key, value in given.items() if value is not None}
    options |= {"distance_m": distance_m, "angle_deg": angle_deg}
    rows = design_table(
        start=options["start_ghz"] * 1e9,
        stop=options["stop_ghz"] * 1e9,
        points=options["points"],
        aperture_length=(options["elements"] - 1) * options["spacing_mm"] * 1e-3,
        elements=options["elements"],
        distance=distance_m,
        angle=float(np.radians(angle_deg)),
    )
    return Design(options=options, rows=rows)


def _radio(scenario: Scenario) -> dict[str, Any]:
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


def design_lines(rows: tuple[DesignRow, ...]) -> list[str]:
    """Format rows as an aligned table."""
    values = [_value(row) for row in rows]
    name_width = max(len(row.name) for row in rows)
    value_width = max(len(f"{value} {row.unit}") for value, row in zip(values, rows, strict=True))
    return [
        f"{row.name:<{name_width}}  {f'{value} {row.unit}':<{value_width}}  {row.note}".rstrip()
        for value, row in zip(values, rows, strict=True)
    ]


def _value(row: DesignRow) -> str:
    return row.value if isinstance(row.value, str) else f"{row.value:.4g}"
