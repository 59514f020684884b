"""The result of a sweep in the Python interface: a table, an array, a plot."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mmslam.table import Table, html, text
from validation.sweep.sweep import Outcome, SweepConfig, statistics
from validation.sweep.tables import error_dataset

if TYPE_CHECKING:  # matplotlib's import takes half a second that not everybody needs
    from matplotlib.axes import Axes


@dataclass(frozen=True, kw_only=True, repr=False)
class Sweep:
    """Position errors of users at all points of a parameter grid."""

    config: SweepConfig
    outcomes: tuple[Outcome, ...]

    def summary(self) -> dict[str, Any]:
        """Return the document of ``sweep.json``: errors for each combination of what is swept."""
        config = self.config
        cases: dict[int, list[Outcome]] = {}
        for one in self.outcomes:
            cases.setdefault(one.point % config.grid_size, []).append(one)
        keys = [key for axis in config.grid for key in axis]
        failed = {one.point: one.reason for one in self.outcomes if one.status == "failed"}
        return {
            "format": 1,
            "title": config.title,
            "seed": config.seed,
            "points": config.points,
            "realisations": config.realisations,
            "failed": len(failed),
            "failures": [{"point": point, "reason": why} for point, why in failed.items()],
            "cases": [
                {
                    "parameters": {key: case[0].parameters[key] for key in keys},
                    **_numbers(case),
                    "found": sum(one.status == "found" for one in case) / len(case),
                }
                for _, case in sorted(cases.items())
            ],
        }

    def to_xarray(self) -> xr.Dataset:
        """Return errors, bounds and statuses over the grid, the realisations and the users."""
        return error_dataset(self.outcomes, self.config)

    def plot(self, *, ax: "Axes | None" = None) -> "Axes":
        """Draw median, 90 % and worst error against what is swept, with the bounds."""
        from mmslam.results.plots import new_axes
        from validation.sweep.figures import draw_errors

        return draw_errors(new_axes() if ax is None else ax, self.outcomes, self.config)

    def __repr__(self) -> str:
        """Show a line for each combination of what is swept."""
        return text([self._table()])

    def _repr_html_(self) -> str:
        return html([self._table()])

    def _table(self) -> Table:
        summary = self.summary()
        rows = []
        for case in summary["cases"]:
            errors = (case["median_m"], case["most_m"], case["worst_m"], told_bound(case))
            told = ["-" if value is None else f"{1e3 * value:.3f}" for value in errors]
            values = ", ".join(f"{key} = {value}" for key, value in case["parameters"].items())
            rows.append((*told, f"{100 * case['found']:.0f}%", values))
        title = f"{summary['points']} points, {summary['failed']} failed"
        heads = ("median/mm", "90 %/mm", "worst/mm", "bound/mm", "found", "at")
        return Table(title=title, heads=heads, rows=rows)


def told_bound(case: Mapping[str, Any]) -> float | None:
    """Return the position bound with estimated walls if there is one, else with known walls [m]."""
    told: float | None = case["bound_with_walls_m"]
    known: float | None = case["bound_m"]
    return known if told is None else told


def _numbers(case: list[Outcome]) -> dict[str, float | None]:
    errors = statistics([one.located for one in case])
    found = dict(zip(("median_m", "most_m", "worst_m"), errors, strict=True))
    for field in ("bound", "bound_with_walls"):
        known = [value for one in case if (value := getattr(one, field)) is not None]
        found[f"{field}_m"] = float(np.median(known)) if known else np.inf
    return {key: value if np.isfinite(value) else None for key, value in found.items()}
