"""Figures of a sweep: errors over the swept key, with their bound, and their distribution.

Each function draws on an Axes and returns it.
"""

import json
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from validation.sweep.sweep import Outcome, SweepConfig, statistics

Case = list[Outcome]


def draw_errors(ax: Axes, outcomes: Sequence[Outcome], config: SweepConfig) -> Axes:
    """Draw median, 90 % and worst error against the swept key, with the error bounds.

    The error of a user that was not found is infinite, so that a curve ends where its share of
    users is no longer found.

    Parameters
    ----------
    ax
        Its axis of errors, in millimetres, becomes logarithmic.
    outcomes, config
        Of the sweep; each combination of the other swept keys has a colour.
    """
    series = _series(outcomes, config)
    colours = _colours(len(series))
    for (name, cases), colour in zip(series.items(), colours, strict=True):
        x = _places(cases, config)
        found = np.array([statistics([one.located for one in case]) for case in cases.values()])
        found[~np.isfinite(found)] = np.nan
        styles = (("-", "o", 2.0), ("-", "^", 1.0), (":", "x", 1.0))
        for column, (line, marker, width) in zip(found.T, styles, strict=True):
            ax.plot(x, 1e3 * column, line, marker=marker, ms=4, lw=width, color=colour)
        for field, line in (("bound", "--"), ("bound_with_walls", "-.")):
            bound = [_median(getattr(one, field) for one in case) for case in cases.values()]
            if np.any(np.isfinite(bound)):
                ax.plot(x, 1e3 * np.array(bound), line, color=colour, lw=1.2, alpha=0.8)
        if name:
            ax.plot([], [], color=colour, lw=2, label=name)
    ax.set_yscale("log")
    _set_axis(ax, series, config)
    ax.set_ylabel("distance from the truth [mm]")
    ax.grid(which="both", alpha=0.25)
    handles, labels = ax.get_legend_handles_labels()
    ax.legend([*handles, *_KEY.values()], [*labels, *_KEY], fontsize=8, ncols=2)
    return ax


def draw_found(ax: Axes, outcomes: Sequence[Outcome], config: SweepConfig) -> Axes:
    """Draw the share of users that were found against the swept key."""
    series = _series(outcomes, config)
    for cases, colour in zip(series.values(), _colours(len(series)), strict=True):
        share = [np.mean([one.status == "found" for one in case]) for case in cases.values()]
        ax.plot(_places(cases, config), 100 * np.array(share), "-o", ms=4, color=colour)
    _set_axis(ax, series, config)
    ax.set_ylim(-5, 105)
    ax.set_ylabel("found [%]")
    ax.grid(alpha=0.25)
    return ax


def draw_distribution(ax: Axes, outcomes: Sequence[Outcome], config: SweepConfig) -> Axes:
    """Draw the share of users within each error, a curve for each swept value.

    Parameters
    ----------
    ax
        Its axis of errors, in millimetres, becomes logarithmic.
    outcomes, config
        Of the sweep; other swept keys than the axis' are merged.
    """
    cases: dict[str, Case] = {}
    for one in outcomes:
        cases.setdefault(_label(one, config), []).append(one)
    colours = colormaps["viridis"](np.linspace(0.0, 0.9, len(cases)))
    for (value, case), colour in zip(cases.items(), colours, strict=True):
        errors = np.sort([one.located for one in case if one.located is not None])
        if errors.size:
            share = 100 * np.arange(1, errors.size + 1) / len(case)
            ax.step(1e3 * errors, share, where="post", color=colour, label=value)
    ax.set_xscale("log")
    ax.set_ylim(0, 102)
    ax.set_xlabel("distance from the truth [mm]")
    ax.set_ylabel("users within it [%]")
    ax.grid(which="both", alpha=0.25)
    ax.legend(title=config.label or config.swept, fontsize=8)
    return ax


_KEY = {
    "median": Line2D([], [], color="0.3", lw=2, marker="o", ms=4),
    "90 %": Line2D([], [], color="0.3", lw=1, marker="^", ms=4),
    "worst": Line2D([], [], color="0.3", lw=1, ls=":", marker="x", ms=4),
    "bound, wall known": Line2D([], [], color="0.3", lw=1.2, ls="--"),
    "bound, rough wall found by echo": Line2D([], [], color="0.3", lw=1.2, ls="-."),
}


def _series(outcomes: Sequence[Outcome], config: SweepConfig) -> dict[str, dict[str, Case]]:
    """Group outcomes by the other swept keys, then by the value along the axis."""
    along = next(keys for keys in config.grid if config.swept in keys)
    others = [keys[0] for keys in config.grid if keys != along]
    series: dict[str, dict[str, Case]] = {}
    for one in outcomes:
        name = ", ".join(f"{key} = {_told(one.parameters[key])}" for key in others)
        cases = series.setdefault(name, {})
        cases.setdefault(json.dumps(one.parameters[config.swept]), []).append(one)
    return series


def _places(cases: dict[str, Case], config: SweepConfig) -> np.ndarray:
    values = [json.loads(value) for value in cases]
    places = _place_of(config)
    if places is not None:
        return np.array([places[json.dumps(value)] for value in values])
    if all(isinstance(value, int | float) for value in values):
        return np.array(values, dtype=np.float64)
    return np.arange(len(values), dtype=np.float64)


def _place_of(config: SweepConfig) -> dict[str, float] | None:
    if config.places is None:
        return None
    values = (json.dumps(value) for value in config.swept_values)
    return dict(zip(values, config.places, strict=True))


def _label(one: Outcome, config: SweepConfig) -> str:
    value = one.parameters[config.swept]
    places = _place_of(config)
    return _told(value if places is None else places[json.dumps(value)])


def _set_axis(ax: Axes, series: dict[str, dict[str, Case]], config: SweepConfig) -> None:
    cases = next(iter(series.values()))
    values = [json.loads(value) for value in cases]
    if config.places is None and not all(isinstance(value, int | float) for value in values):
        ax.set_xticks(range(len(values)), [_told(value) for value in values])
    elif config.logarithmic:
        ax.set_xscale("log")
        places = _places(cases, config)
        ax.set_xticks(places, [_told(float(place)) for place in places], minor=False)
        ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xlabel(config.label or config.swept)


def _told(value: object) -> str:
    if isinstance(value, int | float):
        return f"{value:.4g}"
    return value if isinstance(value, str) else json.dumps(value)


def _median(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else np.nan


def _colours(count: int) -> list[object]:
    return [*colormaps["tab10"](np.arange(count) % 10)]
