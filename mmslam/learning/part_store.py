"""Some samples of a dataset as a store of their own, in the same layout and compression."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from jaxtyping import Int

from mmslam.learning.stored_samples import by_file, open_root, sample_arrays, samples_in_file


def write_part(
    source: Path,
    target: Path,
    samples: Int[np.ndarray, " n"],
    *,
    keep: Callable[[str], bool] = lambda path: True,
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Copy samples, renumbered from 0, and what is the same in all samples.

    The bytes depend on the source and the samples alone.

    Parameters
    ----------
    source
        A dataset.
    target
        A folder that does not exist yet.
    samples
        Their numbers, ascending.
    keep
        Tells by its path whether an array is copied.
    attributes
        Of the new store; None: those of the source.
    """
    root = open_root(source)
    told = root.attrs.asdict() if attributes is None else dict(attributes)
    new = zarr.create_group(target, zarr_format=3, attributes=told)
    varying = sample_arrays(root)
    files = by_file(np.asarray(samples, dtype=np.int64), samples_in_file(root))
    for path, array in sorted(root.members(max_depth=None)):
        if not isinstance(array, zarr.Array) or not keep(path):
            continue
        group, _, name = path.rpartition("/")
        into = new.require_group(group) if group else new
        count = (len(samples),) if path in varying else ()
        shape = (*count, *array.shape[len(count) :])
        made = into.create_array(
            name,
            shape=shape,
            dtype=str if array.dtype.kind == "T" else array.dtype,
            chunks=_at_most(array.chunks, shape),
            shards=None if array.shards is None else _at_most(array.shards, shape),
            compressors=array.compressors,
            fill_value=array.fill_value,
            dimension_names=getattr(array.metadata, "dimension_names", None),
            attributes=array.attrs.asdict(),
        )
        if path not in varying:
            made[...] = np.asarray(array[...])
            continue
        start, held = 0, made.shards or made.chunks
        waiting: list[np.ndarray] = []  # until they fill a file of the new store
        for some in files:
            waiting.append(np.asarray(array.oindex[some.tolist()]))
            while sum(len(one) for one in waiting) >= held[0]:
                ready = np.concatenate(waiting)
                made[start : start + held[0]] = ready[: held[0]]
                start, waiting = start + held[0], [ready[held[0] :]]
        rest = np.concatenate(waiting) if waiting else np.zeros((0, *shape[1:]), array.dtype)
        if len(rest):
            made[start : start + len(rest)] = rest


def _at_most(chunks: tuple[int, ...], shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(max(1, min(one, most)) for one, most in zip(chunks, shape, strict=True))
