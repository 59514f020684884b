"""The ground truth stored with a measurement: read for comparisons only, never by the estimator."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from estimator.measurement.guarded_store import damage_told, opened_store
from estimator.measurement.model import MeasurementError
from estimator.measurement.store import TRUTH

Points = dict[str, Float[np.ndarray, " 3"]]


@dataclass(frozen=True, kw_only=True)
class Truth:
    """True positions of users, walls and targets, by name; empty if unknown."""

    user_position: Points = field(default_factory=dict)  # [m]
    wall_start: Points = field(default_factory=dict)  # [m]
    wall_end: Points = field(default_factory=dict)  # [m]
    target_position: Points = field(default_factory=dict)  # centres of bodies and points [m]
    target_size: Points = field(default_factory=dict)  # along length, depth, height [m]
    target_angle: dict[str, float] = field(default_factory=dict)  # of the length from +x [rad]
    target_kind: dict[str, str] = field(default_factory=dict)  # point, cylinder, box, mesh


def with_box_faces(truth: Truth) -> Truth:
    """Return a truth whose boxes' faces are walls as well, named as in "cabinet, face 2".

    A box's flat faces mirror as walls do, and an image does not tell the ones from the others.
    """
    start, end = dict(truth.wall_start), dict(truth.wall_end)
    for name, kind in truth.target_kind.items():
        if kind != "box" or name not in truth.target_size:
            continue
        angle = truth.target_angle.get(name, 0.0)
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        across = np.array([-along[1], along[0], 0.0])
        half = 0.5 * truth.target_size[name]
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        corners = [
            truth.target_position[name] + x * half[0] * along + y * half[1] * across
            for x, y in signs
        ]
        for number in range(4):
            start[f"{name}, face {number}"] = corners[number]
            end[f"{name}, face {number}"] = corners[(number + 1) % 4]
    return replace(truth, wall_start=start, wall_end=end)


def front_face(
    truth: Truth, target: str, seen_from: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, " 3"]:
    """Return the point of a target's surface that is nearest to the aperture.

    An image shows the target there: a post at its centre plus its radius toward the aperture. For a
    target seen over a mirror, ``seen_from`` is the aperture's image.

    Parameters
    ----------
    truth
        With the target.
    target
        Its name in ``target_position``. A mesh is represented by its bounding box; a target of
        unknown size is a point.
    seen_from
        A point outside of the target. [m]

    Raises
    ------
    KeyError
        If there is no such target.
    """
    centre = truth.target_position[target]
    half = truth.target_size.get(target, np.zeros(3)) / 2
    angle = truth.target_angle.get(target, 0.0)
    cosine, sine = np.cos(angle), np.sin(angle)
    axes = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    local = axes @ (seen_from - centre)
    if truth.target_kind.get(target) == "cylinder":
        radius = float(np.hypot(local[0], local[1]))
        local[:2] *= min(1.0, half[0] / radius) if radius > 0 else 0.0
        local[2] = np.clip(local[2], -half[2], half[2])
    else:
        local = np.clip(local, -half, half)
    face: np.ndarray = centre + axes.T @ local
    return face


def truth_from_dataset(dataset: xr.Dataset | None) -> Truth:
    """Read the truth from the layout ``user_position`` (user, axis), ``wall_start`` (wall, axis).

    Targets are ``target_position`` and ``target_size`` (target, axis), ``target_angle`` and
    ``target_kind`` (target).

    Parameters
    ----------
    dataset
        The group ``truth`` of a measurement store; absent variables are unknown.

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
        target_position=_points(dataset, "target_position", "target"),
        target_size=_points(dataset, "target_size", "target"),
        target_angle={
            name: float(angle)
            for name, angle in _values(dataset, "target_angle", "target").items()
            if np.isfinite(angle)
        },
        target_kind={
            name: str(kind)
            for name, kind in _values(dataset, "target_kind", "target").items()
            if str(kind)
        },
    )


def read_truth(path: Path, *, sample: int | None = None) -> Truth:
    """Read the true positions from a measurement store, as :func:`read_truth_dataset` does."""
    found = read_truth_dataset(path, sample=sample)
    with damage_told(Path(path) / TRUTH):  # values of an unexpected type
        return truth_from_dataset(found)


def read_truth_dataset(path: Path, *, sample: int | None = None) -> xr.Dataset | None:
    """Read the group ``truth`` of a measurement store.

    Parameters
    ----------
    path
        The store's folder.
    sample
        Number of the sample, if the truth has a leading ``sample`` dimension.

    Returns
    -------
    The truth with its paths; None if the store holds none.

    Raises
    ------
    MeasurementError
        If there is such a group, but it cannot be read.
    """
    group = Path(path) / TRUTH
    if not group.exists():
        return None
    try:
        store = opened_store(Path(path))
        with (
            damage_told(group),
            xr.open_zarr(store, group=TRUTH, consolidated=False, chunks=None) as lazy,
        ):
            chosen = lazy.isel(sample=sample or 0) if "sample" in lazy.dims else lazy
            dataset: xr.Dataset = chosen.load()
            return dataset
    except MeasurementError as error:
        raise MeasurementError(
            f"the truth cannot be read: {error}; or delete {group} to go on without a comparison"
        ) from error


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
    points = zip(_labels(dataset, dimension), values, strict=True)
    return {label: point for label, point in points if np.all(np.isfinite(point))}


def _values(dataset: xr.Dataset, name: str, dimension: str) -> dict[str, Any]:
    if name not in dataset:
        return {}
    variable = dataset[name]
    if variable.dims != (dimension,):
        raise MeasurementError(
            f"truth: {name!r} has dimensions {dict(variable.sizes)}; it must have {dimension!r}"
        )
    return dict(zip(_labels(dataset, dimension), variable.values, strict=True))


def _labels(dataset: xr.Dataset, dimension: str) -> list[str]:
    if dimension in dataset.coords:
        return [str(label) for label in dataset[dimension].values]
    return [str(number) for number in range(dataset.sizes[dimension])]
