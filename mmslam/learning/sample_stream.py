"""Samples of a dataset one after the other, divided among workers: what PyTorch calls iterable."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from mmslam.learning.samples import Samples


class SampleStream:
    """Streams samples: whole files in turn, a file shuffled in memory, each worker its own files.

    A worker gets every n-th file of the shuffled order, so that no file is read by two; the workers
    together yield every sample once in an epoch.
    """

    def __init__(self, samples: Samples, *, shuffle: bool = True, seed: int = 0) -> None:
        """Note what is streamed.

        Parameters
        ----------
        samples
            What is gone through.
        shuffle
            Whether in random order.
        seed
            Of the order.
        """
        self.samples = samples
        self.shuffle = shuffle
        self.seed = seed
        self.epoch = 0

    def set_epoch(self, epoch: int) -> None:
        """Choose the order of an epoch, before its loader is gone through."""
        self.epoch = epoch

    def __len__(self) -> int:
        """Count the samples of all workers."""
        return len(self.samples)

    def of_worker(self, worker: int, workers: int) -> Iterator[dict[str, Any]]:
        """Yield the samples of one worker.

        Parameters
        ----------
        worker, workers
            Which one, from 0, of how many.
        """
        rng = np.random.default_rng([self.seed, self.epoch])  # the same in all workers
        files = self.samples.indices_by_file()
        order = rng.permutation(len(files)) if self.shuffle else np.arange(len(files))
        for place, file in enumerate(order):
            within = rng.permutation(files[file]) if self.shuffle else files[file]
            if place % workers == worker:
                yield from self.samples.__getitems__(within.tolist())

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield all samples."""
        return self.of_worker(0, 1)
