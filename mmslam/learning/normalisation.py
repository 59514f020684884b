"""Normalisation constants: means and scales of the training part, computed once and kept."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from jaxtyping import Int

from mmslam.learning.stored_samples import by_file, open_root, sample_arrays, samples_in_file

ATTRIBUTE = "normalisation"
"""Attribute of the store in which they are kept."""


@dataclass(frozen=True, kw_only=True)
class Constants:
    """Mean and scale of one variable: (value − mean) / scale has a mean square of 1."""

    mean: float  # of complex numbers 0: their phases are evenly spread
    scale: float  # standard deviation, or of complex numbers the root mean square of |value|

    def normalised(self, values: np.ndarray) -> np.ndarray:
        """Return values normalised, in the precision they have."""
        scaled: np.ndarray = ((values - self.mean) / self.scale).astype(values.dtype)
        return scaled

    def restored(self, values: np.ndarray) -> np.ndarray:
        """Return the values from which normalised ones were made."""
        found: np.ndarray = (values * self.scale + self.mean).astype(values.dtype)
        return found


def normalisation_constants(
    path: Path, samples: Int[np.ndarray, " n"], *, kept_as: str | None = None
) -> dict[str, Constants]:
    """Return the constants of all variables of real or complex numbers over some samples.

    Sums are in double precision, file after file, so that no more than one is in memory.

    Parameters
    ----------
    path
        The dataset.
    samples
        Those of the training part: constants of others would let the test leak into it.
    kept_as
        A name for these samples, such as a digest: constants that the store's attributes hold under
        it are returned, and new ones are written there, if the store can be written.

    Returns
    -------
    By the variable's path; NaN is left out, and so are variables without a finite value.
    """
    root = open_root(path)
    held: dict[str, Any] = dict(root.attrs.asdict().get(ATTRIBUTE) or {})  # type: ignore[arg-type]
    if kept_as is not None and kept_as in held:
        return {name: Constants(**values) for name, values in held[kept_as].items()}
    found = {}
    files = by_file(np.sort(samples), samples_in_file(root))
    for name, array in sample_arrays(root).items():
        if array.dtype.kind in "fc":
            constants = _of_array(array, files)
            if constants is not None:
                found[name] = constants
    if kept_as is not None:
        held[kept_as] = {name: asdict(one) for name, one in found.items()}
        try:
            zarr.open_group(path, mode="r+").attrs[ATTRIBUTE] = held
        except OSError:
            pass  # a read-only place: they are computed again the next time
    return found


def _of_array(array: zarr.Array[Any], files: list[Int[np.ndarray, " _"]]) -> Constants | None:
    count, total, squares = 0, 0.0, 0.0
    middle = None  # near the mean, so that the variance of large numbers keeps its digits
    for some in files:
        values = np.asarray(array.oindex[some.tolist()])
        values = values[np.isfinite(values)]
        if values.size == 0:
            continue
        if np.iscomplexobj(values):
            middle, sizes = 0.0, np.abs(values).astype(np.float64)
        else:
            middle = float(values.flat[0]) if middle is None else middle
            sizes = values.astype(np.float64) - middle
            total += float(sizes.sum())
        count += values.size
        squares += float((sizes**2).sum())
    if count == 0 or middle is None:
        return None
    mean = total / count
    spread = float(np.sqrt(max(squares / count - mean**2, 0.0)))
    # What does not vary but for rounding is left at its scale: divided by 1.
    varies = spread > 1e-12 * abs(middle + mean)
    return Constants(mean=middle + mean, scale=spread if varies and spread > 0 else 1.0)
