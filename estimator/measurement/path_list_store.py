"""Path lists in the measurement file.

Layout (dimensions in brackets)::

    path_place [path]                       index of the list that a path belongs to
    path_azimuth, path_elevation [path]     rad
    path_delay [path]                       s
    path_gain_db [path]                     dB
    path_user [path_list]                   labels
    path_angle_deviation [path_list]        rad
    path_delay_deviation [path_list]        s
    path_gain_deviation_db [path_list]      dB
    path_frequency [path_list]              Hz

Elevations, gains and frequencies may be missing.
"""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from estimator.measurement.errors import MeasurementError
from estimator.measurement.path_list import PathList

Variables = dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]

LISTS = "path_azimuth"
"""The variable without which a file holds no lists."""


def path_list_variables(lists: tuple[PathList, ...]) -> Variables:
    """Lay lists out as variables of the file's root group.

    Raises
    ------
    MeasurementError
        If some lists have elevations, gains or frequencies, and others have not.
    """
    if not lists:
        return {}
    place = np.repeat(np.arange(len(lists)), [one.azimuth.size for one in lists])
    labels = np.array([one.user for one in lists], dtype=np.dtypes.StringDType())
    found: Variables = {
        "path_place": (("path",), place, {}),
        "path_user": (("path_list",), labels, {}),
    }

    def put(name: str, dimension: str, values: list[Any], unit: str) -> None:
        known = [value is not None for value in values]
        if not any(known):
            return
        if not all(known):
            raise MeasurementError(
                f"{name}: {sum(known)} of {len(known)} lists of paths have it; give it in all or "
                "in none"
            )
        joined = np.concatenate([np.atleast_1d(value) for value in values])
        found[name] = ((dimension,), joined.astype(np.float64), {"units": unit})

    put("path_azimuth", "path", [one.azimuth for one in lists], "rad")
    put("path_elevation", "path", [one.elevation for one in lists], "rad")
    put("path_delay", "path", [one.delay for one in lists], "s")
    put("path_gain_db", "path", [one.gain_db for one in lists], "dB")
    put("path_angle_deviation", "path_list", [one.angle_deviation for one in lists], "rad")
    put("path_delay_deviation", "path_list", [one.delay_deviation for one in lists], "s")
    put("path_gain_deviation_db", "path_list", [one.gain_deviation_db for one in lists], "dB")
    put("path_frequency", "path_list", [one.frequency for one in lists], "Hz")
    return found


def read_path_lists(path: Path, dataset: xr.Dataset) -> tuple[PathList, ...]:
    """Read the lists that a file holds, if any.

    Raises
    ------
    MeasurementError
        If a variable is missing, has other dimensions or is not of numbers.
    """
    if LISTS not in dataset:
        return ()

    def column(name: str, dimension: str) -> np.ndarray:
        if name not in dataset:
            raise MeasurementError(f"{path}: variable {name!r} is missing; write it ({dimension})")
        variable = dataset[name]
        if variable.dims != (dimension,) or variable.dtype.kind not in "iuf":
            raise MeasurementError(
                f"{path}: {name!r} has dimensions {variable.dims} and type {variable.dtype}; it "
                f"must be real, over ({dimension})"
            )
        return np.asarray(variable.values, dtype=np.float64)

    def optional(name: str, dimension: str) -> np.ndarray | None:
        return column(name, dimension) if name in dataset else None

    angle, delay = (column(f"path_{name}_deviation", "path_list") for name in ("angle", "delay"))
    place = column("path_place", "path")
    if not np.all(np.isin(place, np.arange(angle.size))):
        raise MeasurementError(
            f"{path}: 'path_place' is not 0 … {angle.size - 1} everywhere; the store may be "
            "truncated: write it again"
        )
    columns = {
        name: optional(f"path_{name}", "path")
        for name in ("azimuth", "elevation", "delay", "gain_db")
    }
    level, frequency = (
        optional(name, "path_list") for name in ("path_gain_deviation_db", "path_frequency")
    )
    labels = dataset["path_user"].values if "path_user" in dataset else np.arange(angle.size)
    lists = []
    for index, label in enumerate(labels):
        rows = place == index
        parts: dict[str, Any] = {
            name: None if values is None else values[rows] for name, values in columns.items()
        }
        if parts["delay"] is None:
            raise MeasurementError(f"{path}: variable 'path_delay' is missing; write it (path)")
        if level is not None:
            parts["gain_deviation_db"] = float(level[index])
        lists.append(
            PathList(
                user=str(label),
                angle_deviation=float(angle[index]),
                delay_deviation=float(delay[index]),
                frequency=None if frequency is None else float(frequency[index]),
                **parts,
            )
        )
    return tuple(lists)
