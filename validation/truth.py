"""The truth beside a measurement: read for comparisons only, never for an estimate."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr
from jaxtyping import Float

from estimator.measurement import MeasurementError

Points = dict[str, Float[np.ndarray, " 3"]]


@dataclass(frozen=True, kw_only=True)
class Truth:
    """Where things really are, by name; empty where nothing is known."""

    user_position: Points = field(default_factory=dict)  # [m]
    wall_start: Points = field(default_factory=dict)  # [m]
    wall_end: Points = field(default_factory=dict)  # [m]


def truth_from_dataset(dataset: xr.Dataset | None) -> Truth:
    """Take the truth out of the layout ``user_position`` (user, axis), ``wall_start`` (wall, axis).

    Parameters
    ----------
    dataset
        The group ``truth`` of a measurement store; what it lacks stays unknown.

    Raises
    ------
    MeasurementError
        If a variable has other dimensions.
    """
    if dataset is None:
        return Truth()
    return Truth(
        user_position=_points(dataset, "user_position", "user"),
        wall_start=_points(dataset, "wall_start", "wall"),
        wall_end=_points(dataset, "wall_end", "wall"),
    )


def read_truth(path: Path, *, sample: int | None = None) -> Truth:
    """Read the group ``truth`` of a measurement store.

    Parameters
    ----------
    path
        The store's folder.
    sample
        Which one, if the truth has a leading ``sample`` dimension.

    Returns
    -------
    The truth; empty if the store holds none.

    Raises
    ------
    MeasurementError
        If there is such a group, but it cannot be read.
    """
    group = Path(path) / "truth"
    if not group.exists():
        return Truth()
    try:
        with xr.open_zarr(path, group="truth", consolidated=False, chunks=None) as lazy:
            chosen = lazy.isel(sample=sample or 0) if "sample" in lazy.dims else lazy
            dataset = chosen.load()
    except Exception as error:  # Zarr, codecs and JSON fail in many ways on a damaged store
        raise MeasurementError(
            f"{group}: the truth cannot be read ({type(error).__name__}: {error}); delete that "
            "folder to go on without a comparison, or write the store again"
        ) from error
    return truth_from_dataset(dataset)


def _points(dataset: xr.Dataset, name: str, dimension: str) -> Points:
    if name not in dataset:
        return {}
    variable = dataset[name]
    if set(variable.dims) != {dimension, "axis"} or variable.sizes["axis"] != 3:
        raise MeasurementError(
            f"truth: {name!r} has dimensions {dict(variable.sizes)}; "
            f"they must be {dimension!r} and three of 'axis'"
        )
    values = np.asarray(variable.transpose(dimension, "axis").values, dtype=np.float64)
    labels = dataset[dimension].values if dimension in dataset.coords else range(len(values))
    points = zip(map(str, labels), values, strict=True)
    return {label: point for label, point in points if np.all(np.isfinite(point))}
