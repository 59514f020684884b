"""Datasets of PyTorch, which is imported with this module: an extra, ``mmslam[torch]``."""

from collections.abc import Iterator
from typing import Any

from torch.utils.data import Dataset, IterableDataset, get_worker_info

from mmslam.learning.sample_stream import SampleStream
from mmslam.learning.samples import Samples


class TorchSamples(Samples, Dataset):  # type: ignore[misc]  # PyTorch is not installed here
    """:class:`mmslam.learning.samples.Samples` as a ``torch.utils.data.Dataset``."""


class TorchStream(SampleStream, IterableDataset):  # type: ignore[misc]  # as above
    """A stream as an ``IterableDataset``: each worker of a ``DataLoader`` streams its own files."""

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield the samples of this worker."""
        worker = get_worker_info()
        if worker is None:
            return self.of_worker(0, 1)
        return self.of_worker(worker.id, worker.num_workers)
