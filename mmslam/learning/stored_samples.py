"""The arrays of a dataset that have a value for each sample, and how files divide them."""

from pathlib import Path
from typing import Any

import numpy as np
import zarr
from jaxtyping import Int

from estimator.measurement.guarded_store import damage_told, opened_store
from estimator.measurement.model import MeasurementError
from estimator.measurement.store import TRUTH

SIGNALS = ("echo", "uplink")
"""What is measured."""

USUAL = (
    *SIGNALS,
    f"{TRUTH}/user_position",
    f"{TRUTH}/line_of_sight",
    f"{TRUTH}/wall_start",
    f"{TRUTH}/wall_end",
    f"{TRUTH}/path_angle",
    f"{TRUTH}/path_delay",
)
"""What is read unless other variables are asked for: signals, and what is learnt from them."""


def open_root(path: Path) -> zarr.Group:
    """Open a dataset's store.

    Raises
    ------
    MeasurementError
        If it is damaged, or none.
    """
    guarded = opened_store(path)
    with damage_told(path):
        return zarr.open_group(guarded, mode="r")


def sample_arrays(root: zarr.Group) -> dict[str, zarr.Array[Any]]:
    """Return all arrays whose first dimension is ``sample``, by path, in alphabetical order."""
    found = {}
    for path, array in root.members(max_depth=None):
        names = getattr(array.metadata, "dimension_names", None) or ()
        if isinstance(array, zarr.Array) and names[:1] == ("sample",):
            found[path] = array
    return dict(sorted(found.items()))


def chosen_arrays(
    path: Path, root: zarr.Group, variables: tuple[str, ...] | None
) -> dict[str, zarr.Array[Any]]:
    """Return the arrays asked for by their paths; None: those of :data:`USUAL` that there are.

    Raises
    ------
    MeasurementError
        If one is not there, or holds text.
    """
    known = {k: array for k, array in sample_arrays(root).items() if array.dtype.kind != "T"}
    if variables is None:
        return {name: known[name] for name in USUAL if name in known}
    for name in variables:
        if name not in known:
            raise MeasurementError(
                f"{path}: no variable {name!r} of numbers with a value for each sample; known: "
                f"{', '.join(known)}"
            )
    return {name: known[name] for name in variables}


def samples_in_file(root: zarr.Group) -> int:
    """Return how many samples lie together in one file (a shard) of the signals."""
    for name in SIGNALS:
        if isinstance(array := root.get(name), zarr.Array):
            return int((array.shards or array.chunks)[0])
    return 1


def by_file(samples: Int[np.ndarray, " n"], size: int) -> list[Int[np.ndarray, " _"]]:
    """Divide sample numbers into those of each file, in ascending order of files."""
    files = samples // size
    return [samples[files == one] for one in np.unique(files)]
