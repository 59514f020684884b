"""A dataset from Python: a sequence of measurements with their truths, read one by one."""

import hashlib
import importlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Bool, Int
from zarr.storage import LocalStore

from estimator.measurement.model import MeasurementError
from estimator.measurement.store import PARAMETERS, is_store
from mmslam.learning.normalisation import Constants, normalisation_constants
from mmslam.learning.room_split import PARTS, SHARES, split_by_room
from mmslam.learning.sample_stream import SampleStream
from mmslam.learning.samples import Samples
from mmslam.learning.stored_samples import SIGNALS
from mmslam.measurement import Measurement
from mmslam.measurement_files import read
from mmslam.table import Table, html, text


@dataclass(frozen=True, kw_only=True, repr=False)
class Dataset:
    """The samples of a dataset, each a measurement with its truth beside it.

    Samples are read from the file when they are accessed; none is kept in memory.
    """

    path: Path

    def __len__(self) -> int:
        """Count the samples, failed ones included."""
        return int(self._root.sizes["sample"])

    def __getitem__(self, sample: int) -> Measurement:
        """Read one sample.

        Raises
        ------
        IndexError
            If there is none of this number.
        MeasurementError
            If it could not be made; see :attr:`made`.
        """
        count = len(self)
        if not -count <= sample < count:
            raise IndexError(f"{self.path}: sample {sample} of {count}")
        return read(self.path, sample=sample % count)

    def __iter__(self) -> Iterator[Measurement]:
        """Read the samples that could be made, one after the other."""
        return (self[int(sample)] for sample in np.flatnonzero(self.made))

    @cached_property
    def made(self) -> Bool[np.ndarray, " samples"]:
        """Whether each sample could be made."""
        if "status" not in self._root:
            return np.ones(len(self), dtype=bool)
        return np.asarray(self._root["status"].values == 0)

    @cached_property
    def parameters(self) -> xr.Dataset | None:
        """Drawn parameters of each sample, by key; None if the file does not hold them."""
        if not (self.path / PARAMETERS).exists():
            return None
        drawn: xr.Dataset = xr.open_zarr(
            self.path, group=PARAMETERS, consolidated=False, chunks=None
        )
        return drawn

    def to_xarray(self) -> xr.Dataset:
        """Return all samples as one lazy dataset, in the layout of the file, without the truth.

        How the file divides them into chunks is left out: some samples, chosen by ``isel``, are
        written by ``to_zarr`` or ``to_netcdf`` in chunks of their own.
        """
        return self._root.drop_encoding()

    @cached_property
    def rooms(self) -> Int[np.ndarray, " samples"]:
        """Number of each sample's room: equal where walls are the same, roughness included.

        Raises
        ------
        MeasurementError
            If the file is of a version that did not keep it.
        """
        if "room" not in self._root:
            raise MeasurementError(
                f"{self.path}: does not say which samples are in one room (no variable `room`): an "
                "earlier version of mmslam made it; make it anew"
            )
        return np.asarray(self._root["room"].values, dtype=np.int64)

    def split(
        self, *, shares: Sequence[float] = SHARES, seed: int = 0
    ) -> dict[str, Int[np.ndarray, " _"]]:
        """Divide the samples that could be made into train, validation and test, by room.

        No two parts have a room in common, so that what is learnt from a wall in training is not
        found again in the test.

        Parameters
        ----------
        shares
            Of the rooms in training, validation and test. [-]
        seed
            Another one gives another division.

        Returns
        -------
        Sample numbers, ascending, by the names ``train``, ``validation`` and ``test``.

        Raises
        ------
        MeasurementError
            If there are fewer than three rooms.
        """
        made = np.flatnonzero(self.made)
        parts = split_by_room(self.rooms[made], shares=shares, seed=seed)
        return {part: made[some] for part, some in parts.items()}

    def normalisation(
        self, *, part: str | None = "train", split_seed: int = 0
    ) -> dict[str, Constants]:
        """Return means and scales of all variables over the training part, by path.

        They are computed once and kept in the attributes of the store.

        Parameters
        ----------
        part, split_seed
            As in :meth:`samples`.
        """
        numbers = self._numbers(part, split_seed)
        digest = hashlib.sha256(numbers.astype("<i8").tobytes()).hexdigest()[:16]
        return normalisation_constants(self.path, numbers, kept_as=digest)

    def samples(
        self,
        part: str | None = None,
        *,
        variables: Sequence[str] | None = None,
        normalise: bool | Sequence[str] = False,
        split_seed: int = 0,
    ) -> Samples:
        """Return samples as dictionaries of arrays, for learning with any library.

        Parameters
        ----------
        part
            ``"train"``, ``"validation"`` or ``"test"``, as :meth:`split` divides; None: all.
        variables
            Their paths; None: echo, uplink, and the usual labels.
        normalise
            True: echo and uplink, by the constants of the training part (of all samples, if
            ``part`` is None); or the paths of the variables that are normalised.
        split_seed
            Of the division into parts: the same wherever parts must not share a room.

        Raises
        ------
        MeasurementError
            If there is no such part or variable, or the file has too few rooms to be divided.
        """
        constants: dict[str, Constants] = {}
        if normalise is not False:
            known = self.normalisation(part="train" if part else None, split_seed=split_seed)
            wanted = SIGNALS if normalise is True else tuple(normalise)
            constants = {name: known[name] for name in wanted if name in known}
            if normalise is not True and len(constants) < len(wanted):
                missing = sorted(set(wanted) - set(constants))
                raise MeasurementError(
                    f"{self.path}: {missing[0]!r} has no normalisation constants; known: "
                    f"{', '.join(known)}"
                )
        numbers = self._numbers(part, split_seed)
        return Samples(self.path, numbers, variables=variables, constants=constants)

    def torch(
        self,
        part: str | None = None,
        *,
        stream: bool = False,
        shuffle: bool = True,
        variables: Sequence[str] | None = None,
        normalise: bool | Sequence[str] = False,
        seed: int = 0,
        split_seed: int = 0,
    ) -> Any:
        """Return samples as a dataset of PyTorch, for its ``DataLoader``.

        Parameters
        ----------
        part, variables, normalise, split_seed
            As of :meth:`samples`.
        stream
            An ``IterableDataset``, whose workers each stream their own files, in place of a
            ``Dataset`` with samples by index.
        shuffle
            Of a stream. With samples by index, the ``DataLoader`` shuffles.
        seed
            Of a stream's order, which depends on it and on what ``set_epoch`` was given.

        Raises
        ------
        MeasurementError
            As of :meth:`samples`; and if PyTorch is not installed.
        """
        try:
            module = importlib.import_module("mmslam.learning.torch_dataset")
        except ImportError as error:
            if (error.name or "").split(".")[0] != "torch":
                raise
            raise MeasurementError(
                "PyTorch is not installed: install `mmslam[torch]`, or use .samples(), which gives "
                "the same as NumPy arrays"
            ) from error
        found = self.samples(part, variables=variables, normalise=normalise, split_seed=split_seed)
        if stream:
            return module.TorchStream(found, shuffle=shuffle, seed=seed)
        return module.TorchSamples(
            self.path, found.numbers, variables=found.variables, constants=found.constants
        )

    def stream(
        self, part: str | None = None, *, shuffle: bool = True, seed: int = 0, **asked: Any
    ) -> SampleStream:
        """Return what ``torch(stream=True)`` does without PyTorch: samples, file after file."""
        found = self.samples(part, **asked)
        return SampleStream(found, shuffle=shuffle, seed=seed)

    def _numbers(self, part: str | None, split_seed: int) -> Int[np.ndarray, " _"]:
        if part is None:
            return np.flatnonzero(self.made)
        if part not in PARTS:
            raise MeasurementError(f"part = {part!r}: give one of {', '.join(PARTS)}, or None")
        return self.split(seed=split_seed)[part]

    @cached_property
    def _root(self) -> xr.Dataset:
        store = LocalStore(self.path, read_only=True)
        root: xr.Dataset = xr.open_zarr(store, consolidated=False, chunks=None)
        return root

    def __repr__(self) -> str:
        """Show what it holds."""
        return text([self._table()])

    def _repr_html_(self) -> str:
        return html([self._table()])

    def _table(self) -> Table:
        rows = [("samples", f"{len(self)}, {int(np.sum(~self.made))} of them failed")]
        for name in ("echo", "uplink"):
            if name in self._root:
                sizes = self._root[name].sizes
                rows.append((name, ", ".join(f"{key} {size}" for key, size in sizes.items())))
        return Table(title=str(self.path), rows=rows)


def open_dataset(path: str | Path) -> Dataset:
    """Open a dataset that :func:`mmslam.make_dataset` or ``mmslam dataset`` has made.

    Raises
    ------
    MeasurementError
        If it is none.

    Examples
    --------
    >>> import mmslam
    >>> config = {
    ...     "base": "point_scatterers",
    ...     "count": 2,
    ...     "set": {"base_station.elements": 8, "radio.points": 8},
    ... }
    >>> mmslam.make_dataset(config, "points.zarr").made_now
    2
    >>> points = mmslam.open_dataset("points.zarr")
    >>> len(points)
    2
    >>> points[1].echo.samples.shape
    (8, 8)
    """
    path = Path(path)
    if not is_store(path):
        raise MeasurementError(
            f"{path}: not a Zarr v3 group (no zarr.json in it); make a dataset by "
            "mmslam.make_dataset, or `mmslam dataset`"
        )
    dataset = Dataset(path=path)
    if "sample" not in dataset.to_xarray().sizes:
        raise MeasurementError(f"{path}: no 'sample' dimension; read it with mmslam.read")
    return dataset
