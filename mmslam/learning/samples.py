"""Samples of a dataset by number, as dictionaries of arrays: what PyTorch calls map-style."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int

from estimator.measurement.guarded_store import damage_told
from mmslam.learning.normalisation import Constants
from mmslam.learning.stored_samples import chosen_arrays, open_root, samples_in_file


class Samples:
    """Some samples of a dataset; it holds none of them, and reads each when it is asked for.

    It has a length and gives samples by index, all that a ``torch.utils.data.DataLoader`` asks
    for; no PyTorch is needed. The store is opened in each process by itself. Indices are those of
    this object, ``numbers`` the samples' numbers in the store.
    """

    def __init__(
        self,
        path: str | Path,
        numbers: Int[np.ndarray, " n"],
        *,
        variables: Sequence[str] | None = None,
        constants: Mapping[str, Constants] | None = None,
    ) -> None:
        """Note what is asked for, and check that it is there.

        Parameters
        ----------
        path
            The dataset.
        numbers
            Of the samples, in the store.
        variables
            Their paths, such as ``"truth/user_position"``; None: signals and the usual labels.
        constants
            By path, of the variables that are normalised.

        Raises
        ------
        MeasurementError
            If a variable is not there.
        """
        self.path = Path(path)
        self.numbers = np.asarray(numbers, dtype=np.int64)
        root = open_root(self.path)
        asked = None if variables is None else tuple(variables)
        self.variables = tuple(chosen_arrays(self.path, root, asked))
        self.constants = dict(constants or {})
        self.file_samples = samples_in_file(root)
        self._arrays: dict[str, Any] | None = None

    def __len__(self) -> int:
        """Count them."""
        return len(self.numbers)

    def __getitem__(self, index: int) -> dict[str, Any]:
        """Read one sample.

        Raises
        ------
        IndexError
            If there is none of this index.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"{self.path}: sample {index} of {len(self)}")
        return self.__getitems__([index])[0]

    def __getitems__(self, indices: Sequence[int]) -> list[dict[str, Any]]:
        """Read several samples at once, each file once: what a ``DataLoader`` does for a batch."""
        numbers = self.numbers[np.asarray(indices, dtype=np.int64)]
        if self._arrays is None:  # in each process by itself
            self._arrays = chosen_arrays(self.path, open_root(self.path), self.variables)
        unique, places = np.unique(numbers, return_inverse=True)
        with damage_told(self.path):
            read = {
                name: self._normalised(name, np.asarray(array.oindex[unique.tolist()]))
                for name, array in self._arrays.items()
            }
        return [
            {"sample": int(number), **{name: values[place] for name, values in read.items()}}
            for number, place in zip(numbers, places, strict=True)
        ]

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Go through all samples in order."""
        return (self[index] for index in range(len(self)))

    def shuffled(self, *, seed: int, epoch: int = 0) -> Iterator[int]:
        """Yield all indices, files in random order, and random within each file.

        So each file is read once, which keeps disks and networks busy without seeking; give it as
        ``sampler`` to a ``DataLoader``.

        Parameters
        ----------
        seed, epoch
            The order depends on these two alone.
        """
        rng = np.random.default_rng([seed, epoch])
        files = self.indices_by_file()
        for file in rng.permutation(len(files)):
            yield from (int(index) for index in rng.permutation(files[file]))

    def indices_by_file(self) -> list[Int[np.ndarray, " _"]]:
        """Return the indices of the samples in each file of the store, in order."""
        order = np.argsort(self.numbers, kind="stable")
        files = self.numbers[order] // self.file_samples
        return np.split(order, np.flatnonzero(np.diff(files)) + 1) if len(order) else []

    def __getstate__(self) -> dict[str, Any]:
        """Leave the open store behind when another process is given a copy."""
        return {**self.__dict__, "_arrays": None}

    def _normalised(self, name: str, values: np.ndarray) -> np.ndarray:
        known = self.constants.get(name)
        return values if known is None else known.normalised(values)
