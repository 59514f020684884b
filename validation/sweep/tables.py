"""The outcomes of a sweep as tables: one line each in CSV, an array over the grid in xarray."""

import csv
import io
import json
from collections.abc import Sequence

import numpy as np
import xarray as xr

from scenes.sampling.sample_space import SampleSpace
from validation.sweep.sweep import Outcome, SweepConfig

COLUMNS = {
    "error": "error_m",
    "deviation": "deviation_m",
    "bound": "bound_m",
    "bound_with_walls": "bound_with_walls_m",
    "wall_angle": "wall_angle_rad",
    "wall_offset": "wall_offset_m",
}
"""Quantities of an outcome, and their column names with units."""

_MEANINGS = {
    "error": "distance of the estimate from the true position",
    "deviation": "the standard deviation that the estimate claims",
    "bound": "position error bound, the walls known",
    "bound_with_walls": "the same; walls as their rough echo tells, which bend the pilot",
    "wall_angle": "angle between the estimated and the true wall",
    "wall_offset": "of the true wall's centre from the estimated one",
}


def error_table(outcomes: Sequence[Outcome], space: SampleSpace) -> str:
    """Write outcomes as CSV, a line for each user of each point.

    Parameters
    ----------
    outcomes
        Of the sweep.
    space
        Of its points; gives the varied keys.
    """
    keys = [one.key for one in space.parameters]
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["point", "realisation", *keys, "user", "status", *COLUMNS.values(), "reason"])
    for one in outcomes:
        values = [_cell(one.parameters.get(key)) for key in keys]
        numbers = [_cell(getattr(one, name)) for name in COLUMNS]
        status = [one.user, one.status, *numbers, one.reason or ""]
        writer.writerow([one.point, one.realisation, *values, *status])
    return text.getvalue()


def error_dataset(outcomes: Sequence[Outcome], config: SweepConfig) -> xr.Dataset:
    """Arrange outcomes over the axes of the grid, the realisations and the users.

    Parameters
    ----------
    outcomes, config
        Of the sweep.

    Returns
    -------
    A variable for each of :data:`COLUMNS`, and ``status``; NaN and "" for absent users. The grid's
    axes are named by their (first) key.
    """
    users = list(dict.fromkeys(one.user for one in outcomes))
    axes = config.grid
    names = tuple(keys[0] for keys in axes)
    shape = (*axes.values(), config.realisations, len(users))
    dimensions = (*names, "realisation", "user")
    numbers = {name: np.full(shape, np.nan) for name in COLUMNS}
    status = np.full(shape, "", dtype=np.dtypes.StringDType())
    for one in outcomes:
        place = np.unravel_index(one.point % config.grid_size, tuple(axes.values()))
        at = (*(int(step) for step in place), one.realisation, users.index(one.user))
        status[at] = one.status
        for name, values in numbers.items():
            found = getattr(one, name)
            values[at] = np.nan if found is None else found
    variables = {
        name: (
            dimensions,
            values,
            {"units": COLUMNS[name].rpartition("_")[2], "long_name": _MEANINGS[name]},
        )
        for name, values in numbers.items()
    }
    dataset = xr.Dataset(variables)
    dataset["status"] = (dimensions, status)
    labels = np.array(users, dtype=np.dtypes.StringDType())
    dataset = dataset.assign_coords(user=("user", labels))
    for keys in axes:
        for key in keys:
            drawn = config.vary[key]
            assert drawn.kind in ("grid", "list")
            dataset = dataset.assign_coords({key: (keys[0], _coordinate(drawn.values))})
    dataset.attrs = {
        "title": config.title or f"errors of {config.base}",
        "seed": config.seed,
        "config": json.dumps(config.model_dump(), sort_keys=True),
    }
    return dataset


def _coordinate(values: Sequence[object]) -> np.ndarray:
    numeric = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    if numeric:
        return np.array(values, dtype=np.float64)
    texts = [value if isinstance(value, str) else json.dumps(value) for value in values]
    return np.array(texts, dtype=np.dtypes.StringDType())


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    return value if isinstance(value, str) else json.dumps(value)
