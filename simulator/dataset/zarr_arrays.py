"""The Zarr arrays of a dataset: layout, chunks and compression."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.codecs import BloscCodec

from simulator.dataset.layout import LABEL_SAMPLES, Layout
from simulator.dataset.variables import FAILED, TEXT, Variable


def create_store(path: Path, layout: Layout) -> None:
    """Write an empty dataset: all metadata, and the variables common to all samples.

    Parameters
    ----------
    path
        A folder that does not exist yet.
    layout
        Of the dataset.
    """
    root = zarr.create_group(path, zarr_format=3, attributes=dict(layout.attributes))
    names = {one.group for one in layout.variables} | {one.group for one in layout.constants}
    groups = {"": root} | {name: root.create_group(name) for name in sorted(names - {""})}
    for constant in layout.constants:
        text = constant.values.dtype.kind == "T"
        array = groups[constant.group].create_array(
            constant.name,
            shape=constant.values.shape,
            dtype=str if text else constant.values.dtype,
            chunks=constant.values.shape,
            fill_value="" if text else float("nan"),
            dimension_names=constant.dimensions,
            attributes=dict(constant.attributes),
        )
        array[...] = constant.values
    for variable in layout.variables:
        _create(groups[variable.group], variable, layout)


def failed_samples(path: Path) -> Iterator[int]:
    """Yield the samples of a finished dataset that could not be made."""
    array = stored_array(zarr.open_group(path, mode="r"), "status")
    for start in range(0, array.shape[0], LABEL_SAMPLES):
        status = np.asarray(array[start : start + LABEL_SAMPLES])
        for at in np.flatnonzero(status == FAILED):
            yield start + int(at)


def stored_array(group: zarr.Group, key: str) -> zarr.Array[Any]:
    """Open an array of a dataset."""
    found = group[key]
    assert isinstance(found, zarr.Array)  # the store is one that create_store made
    return found


def codec(variable: Variable) -> BloscCodec:
    """Return the codec of a large variable.

    Bytes are shuffled by significance first: signs and exponents compress, the mantissas of noisy
    samples do not. Lossless compression saves some 10 %.
    """
    part = np.dtype(variable.type).itemsize // 2
    return BloscCodec(cname="zstd", clevel=3, shuffle="shuffle", typesize=part)


def _create(group: zarr.Group, variable: Variable, layout: Layout) -> None:
    shape = (layout.samples, *variable.shape)
    names = ("sample", *variable.dimensions)
    if variable.large:
        group.create_array(
            variable.name,
            shape=shape,
            dtype=variable.type,
            chunks=(1, *variable.shape),
            shards=(layout.block, *variable.shape),
            compressors=[codec(variable)],
            fill_value=variable.missing,
            dimension_names=names,
            attributes=dict(variable.attributes),
        )
        return
    group.create_array(
        variable.name,
        shape=shape,
        dtype=str if variable.type == TEXT else variable.type,
        chunks=(min(LABEL_SAMPLES, layout.samples), *variable.shape),
        fill_value=variable.missing,
        dimension_names=names,
        attributes=dict(variable.attributes),
    )
