"""A dataset from Python: a sequence of measurements with their truths, read one by one."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr
from jaxtyping import Bool
from zarr.storage import LocalStore

from estimator.measurement.model import MeasurementError
from estimator.measurement.store import PARAMETERS, is_store
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
