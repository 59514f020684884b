"""Reading of one numeric array by file and name, independent of the file format."""

from pathlib import Path
from typing import Any

import numpy as np

from estimator.measurement.model import MeasurementError
from mmslam.formats.hdf5_files import hdf5_array, is_hdf5
from mmslam.formats.matlab_files import matlab_array
from mmslam.formats.numpy_files import npy_array, npz_arrays
from mmslam.formats.text.csv_columns import CsvGrid, read_csv_grid
from mmslam.formats.text.text_numbers import read_matrix
from mmslam.formats.time_domain.gssi_files import read_dzt
from scenes.files.toml_reader import is_file

LARGEST = 2**28
"""Most values of one array: 4 GiB as complex numbers. A file of some bytes can promise more."""

SUFFIXES = {
    ".mat": "mat",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".he5": "hdf5",
    ".nc": "netcdf",
    ".nc4": "netcdf",
    ".cdf": "netcdf",
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".dat": "csv",
    ".asc": "csv",
    ".out": "hdf5",
    ".dzt": "dzt",
    ".npz": "npz",
    ".npy": "npy",
}
"""What a file's name says about its format."""

NAMELESS = ("npy", "csv", "dzt")
"""Formats whose files may hold one array without a name."""

RECORDS = (("r", "i"), ("re", "im"), ("real", "imag"), ("i", "q"))
"""Names of the two parts of records that are complex numbers."""

_NETCDF_3 = (b"CDF\x01", b"CDF\x02")


class ArrayFiles:
    """Reads arrays by file and name; a CSV file is read once."""

    def __init__(self, *, frequency: str | None, coordinates: tuple[str, ...]) -> None:
        """Take the names of the columns that hold a CSV row's frequency and position."""
        self._frequency = frequency
        self._coordinates = coordinates
        self._tables: dict[Path, CsvGrid] = {}

    def array(self, path: Path, name: str | None, *, gaps: bool = False) -> np.ndarray:
        """Read an array of numbers.

        Parameters
        ----------
        path
            The file.
        name
            The variable, dataset or column; None for an .npy file of one array (of several, it is
            their number, from 0), a GSSI file, and a text file that is one matrix.
        gaps
            Accept NaN, which marks positions that were not measured; the caller removes them.

        Raises
        ------
        MeasurementError
            If the file is not what its name says, or holds no such array of finite numbers.
        """
        kind = format_of(path)
        if name is None and kind not in NAMELESS:
            raise MeasurementError(
                f"{path}: which of its arrays? name it by variable in the mapping"
            )
        values = self._nameless(path, kind) if name is None else self._named(path, kind, name)
        values = _complex_of_records(values)
        if values.dtype.kind not in "iufc":
            raise MeasurementError(
                f"{path}: {name or 'the array'!r} holds {values.dtype}; only numbers are read"
            )
        if values.size == 0:
            raise MeasurementError(
                f"{path}: {name or 'the array'!r} is empty (shape {values.shape}); choose another"
            )
        bad = np.count_nonzero(np.isinf(values) if gaps else ~np.isfinite(values))
        if bad:
            raise MeasurementError(
                f"{path}: {bad} of {values.size} values of {name or 'the array'!r} are NaN, "
                "infinite or missing; measure again, or remove those positions"
            )
        return values

    def _nameless(self, path: Path, kind: str) -> np.ndarray:
        match kind:
            case "csv":
                return read_matrix(path)
            case "dzt":
                return read_dzt(path).traces
        return npy_array(path)

    def _named(self, path: Path, kind: str, name: str) -> np.ndarray:
        match kind:
            case "csv":
                if path not in self._tables:
                    self._tables[path] = read_csv_grid(
                        path, frequency=self._frequency, coordinates=self._coordinates
                    )
                return self._tables[path].array(name)
            case "npy":
                return npy_array(path, name)
            case "dzt":
                raise MeasurementError(
                    f"{path}: a GSSI file holds one array without a name; leave variable out"
                )
            case "npz":
                return npz_arrays(path, only=name, largest=LARGEST)[name]
            case "mat":
                return matlab_array(path, name, largest=LARGEST)
            case _ if is_hdf5(path):
                return hdf5_array(path, name, largest=LARGEST)
            case "netcdf" if _is_netcdf_3(path):
                return _netcdf_3_array(path, name)
        raise MeasurementError(
            f"{path}: not an HDF5{' or NetCDF' if kind == 'netcdf' else ''} file, whatever its "
            "name says; export it again"
        )


def _complex_of_records(values: np.ndarray) -> np.ndarray:
    """Join pairs of a real and an imaginary part, as integer I and Q are stored."""
    names = values.dtype.names or ()
    if tuple(name.lower() for name in names) not in RECORDS:
        return values
    real, imaginary = (values[name] for name in names)
    if real.dtype.kind not in "iuf" or imaginary.dtype.kind not in "iuf":
        return values
    return np.asarray(real.astype(np.float64) + 1j * imaginary.astype(np.float64))


def format_of(path: Path) -> str:
    """Name the format of a file.

    Raises
    ------
    MeasurementError
        If there is no such file, or its suffix is unknown.
    """
    if not is_file(path):
        raise MeasurementError(f"{path}: no such file; correct its name in the mapping")
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None:
        raise MeasurementError(
            f"{path}: unknown suffix {path.suffix!r}; give a folder of Touchstone files, or one "
            f"of {', '.join(SUFFIXES)}"
        )
    return kind


def is_csv(path: Path) -> bool:
    """Tell whether a file's name says that it is a table of text."""
    return SUFFIXES.get(path.suffix.lower()) == "csv"


def _is_netcdf_3(path: Path) -> bool:
    with path.open("rb") as stream:
        return stream.read(4) in _NETCDF_3


def _netcdf_3_array(path: Path, name: str) -> np.ndarray:
    from scipy.io import netcdf_file

    try:
        with netcdf_file(path, "r", mmap=False, maskandscale=True) as file:
            if name not in file.variables:
                found = ", ".join(file.variables) or "none"
                raise MeasurementError(f"{path}: no variable {name!r} (found: {found}); choose one")
            values: Any = np.ma.asarray(file.variables[name][:])
    except MeasurementError:
        raise
    except Exception as error:  # SciPy fails in many ways on a damaged file
        raise MeasurementError(
            f"{path}: cannot be read as NetCDF ({type(error).__name__}: {error}); it may be "
            "truncated: copy it again"
        ) from error
    if np.ma.is_masked(values):
        return np.asarray(values.astype(np.float64).filled(np.nan))
    native = np.asarray(values.data)  # the file is big-endian
    return native.astype(native.dtype.newbyteorder("="))
