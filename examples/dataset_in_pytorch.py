"""Read a dataset in PyTorch, or without it: samples of numbers in, positions of users out.

Run as ``python examples/dataset_in_pytorch.py FILE.zarr``; make the file by ``mmslam dataset``.

:class:`Samples` holds no data: it opens the store when it is first asked for a sample, and so in
each worker process of a ``DataLoader`` by itself. With PyTorch it is a ``Dataset`` of the map
kind::

    loader = torch.utils.data.DataLoader(Samples("rooms.zarr"), batch_size=32, num_workers=4,
                                         shuffle=True)
    for batch in loader:
        batch["uplink"]         # complex64 [32, user, element, frequency]
        batch["user_position"]  # float64 [32, user, axis], in metres; NaN: there is no such user

Samples of one file (a shard, see ``.block``) lie together: on a spinning disk or a network drive
shuffle whole blocks, and the samples within them, by :func:`shuffled_by_block`::

    loader = DataLoader(samples, batch_size=32, sampler=shuffled_by_block(samples, seed=epoch))

Without PyTorch, ``samples[3]`` and ``for sample in samples`` give the same as NumPy arrays.
"""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import zarr

try:
    Base: Any = importlib.import_module("torch.utils.data").Dataset
except ImportError:  # PyTorch is no part of mmslam
    Base = object

LABELS = ("user_position", "line_of_sight", "wall_start", "wall_end", "path_angle", "path_delay")
"""What of the group ``truth`` is learnt from; there is more."""


class Samples(Base):  # type: ignore[misc]  # PyTorch is not installed here
    """The samples of a dataset that could be made, in order."""

    def __init__(self, path: str | Path) -> None:
        """Look which samples there are.

        Parameters
        ----------
        path
            The store that ``mmslam dataset`` has written.
        """
        self.path = Path(path)
        root: Any = zarr.open_group(self.path, mode="r")
        self.numbers = np.flatnonzero(np.asarray(root["status"]) == 0)
        self.block: int = root["echo"].shards[0]  # samples in one file
        self._root: Any = None

    def __len__(self) -> int:
        """Count them."""
        return len(self.numbers)

    def __getitem__(self, index: int) -> dict[str, Any]:
        """Read one: echo, uplink, and :data:`LABELS`."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"sample {index} of {len(self)}")
        if self._root is None:  # in each process by itself
            self._root = zarr.open_group(self.path, mode="r")
        number = int(self.numbers[index])
        names = [name for name in ("echo", "uplink") if name in self._root]
        labels = [name for name in LABELS if f"truth/{name}" in self._root]
        sample = {name: np.asarray(self._root[name][number]) for name in names}
        sample |= {name: np.asarray(self._root[f"truth/{name}"][number]) for name in labels}
        return sample | {"sample": number}

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Go through all of them."""
        return (self[index] for index in range(len(self)))

    def __getstate__(self) -> dict[str, Any]:
        """Leave the open store behind when a worker process is given a copy."""
        return {**self.__dict__, "_root": None}


def shuffled_by_block(samples: Samples, *, seed: int) -> Iterator[int]:
    """Yield all indices, the files in random order, and random within each file.

    Parameters
    ----------
    samples
        What is gone through.
    seed
        Of the order: another one for each epoch.
    """
    rng = np.random.default_rng(seed)
    blocks = samples.numbers // samples.block
    for block in rng.permutation(np.unique(blocks)):
        yield from (int(index) for index in rng.permutation(np.flatnonzero(blocks == block)))


if __name__ == "__main__":
    samples = Samples(sys.argv[1])
    print(f"{len(samples)} samples, {samples.block} in a file")
    for index in list(shuffled_by_block(samples, seed=0))[:3]:
        sample = samples[index]
        shapes = {name: np.shape(values) for name, values in sample.items() if np.shape(values)}
        print(f"sample {sample['sample']}: {shapes}")
