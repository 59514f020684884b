"""A measurement or a dataset, or some of its samples, as one NetCDF or MATLAB file.

Both hold what the store holds, groups and all: NetCDF as groups, MATLAB as structures. Read some
samples at a time, NetCDF takes a dataset of any size; MATLAB's format holds 2 GiB a variable.
"""

import importlib
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from estimator.measurement.guarded_store import (
    MOST_VALUES,
    damage_told,
    opened_store,
    shortened,
)
from estimator.measurement.model import MeasurementError
from mmslam.output import OutputError, new_file, reserved

SAMPLES_AT_ONCE = 64
"""Samples that are in memory together while NetCDF is written."""

MOST_ARRAYS = 10_000
"""Most arrays of a store that is exported. [-]"""

LARGEST_IN_MATLAB = 2**31 - 1
"""Most bytes of one variable in a MATLAB file of version 5. [byte]"""


@dataclass(frozen=True, kw_only=True)
class StoredArray:
    """One variable of a store."""

    store: Path
    group: str  # "" is the root
    name: str
    array: Any  # of Zarr
    dimensions: tuple[str, ...]
    samples: Sequence[int] | None  # those chosen; None: it has no such dimension

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of what was chosen."""
        shape: tuple[int, ...] = self.array.shape
        return shape if self.samples is None else (len(self.samples), *shape[1:])

    @property
    def size(self) -> int:
        """How many values were chosen."""
        return math.prod(self.shape)

    def read(self, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Read what was chosen, or some of the chosen samples.

        Raises
        ------
        MeasurementError
            If it cannot be read, or is more than a measurement's.
        """
        shape = self.shape
        chosen = None if self.samples is None else list(self.samples[start:stop])
        count = self.size if chosen is None else len(chosen) * math.prod(shape[1:])
        if count > MOST_VALUES:
            raise MeasurementError(
                f"{self.store}: {shortened(self.name)} of shape {shape} holds {count} values at "
                f"once, more than {MOST_VALUES}; choose some samples with --sample"
            )
        with damage_told(self.store):
            if chosen is None:
                return np.asarray(self.array[...])
            if chosen == list(range(chosen[0], chosen[0] + len(chosen))):
                return np.asarray(self.array[chosen[0] : chosen[0] + len(chosen)])
            return np.asarray(self.array.oindex[chosen])


def export_netcdf(store: Path, file: Path, *, samples: Sequence[int] | None = None) -> int:
    """Write a store as NetCDF-4, complex numbers as netCDF4's ``auto_complex`` reads them.

    Parameters
    ----------
    store
        A measurement or a dataset.
    file
        The file to write; it must not exist.
    samples
        Sample numbers of a dataset; None: all.

    Returns
    -------
    The number of variables.

    Raises
    ------
    MeasurementError, OutputError
        If the store cannot be read, a sample is not there, or the file cannot be written.
    """
    try:
        netcdf = importlib.import_module("netCDF4")
    except ImportError as error:
        raise OutputError(
            "NetCDF needs another package: install `mmslam[netcdf]`, or export to --matlab"
        ) from error
    root = _opened(store)
    arrays = _arrays(root, store, samples)
    with (
        _new(file, "NetCDF") as part,
        netcdf.Dataset(part, "w", auto_complex=True) as written,
    ):
        written.setncatts(_attributes(root.attrs.asdict()))
        for one in arrays:
            group = written.createGroup(one.group) if one.group else written
            for dimension, length in zip(one.dimensions, one.shape, strict=True):
                if dimension not in group.dimensions:
                    group.createDimension(dimension, length)
            text = one.array.dtype.kind == "T"
            kind = str if text else np.dtype(one.array.dtype.str[1:])  # in this machine's order
            packed = {} if text or not one.shape else {"compression": "zlib", "complevel": 1}
            variable = group.createVariable(one.name, kind, one.dimensions, **packed)
            variable.setncatts(_attributes(one.array.attrs.asdict()))
            if one.samples is None:
                variable[...] = _plain(one.read())
            else:
                for start in range(0, len(one.samples), SAMPLES_AT_ONCE):
                    values = one.read(start, start + SAMPLES_AT_ONCE)
                    variable[start : start + len(values)] = _plain(values)
    return len(arrays)


def export_matlab(store: Path, file: Path, *, samples: Sequence[int] | None = None) -> int:
    """Write a store as a MATLAB file of version 5; arguments as of :func:`export_netcdf`.

    Groups are structures. A key such as ``noise.snr_db`` is called ``noise_snr_db``; units and
    other attributes are in the structure ``attributes``. A script beside it, ``read_me_NAME.m``,
    says what each variable is, and loads and plots the first sweep.
    """
    from scipy.io import savemat

    root = _opened(store)
    arrays = _arrays(root, store, samples)
    content: dict[str, Any] = {}
    told: dict[str, Any] = {}
    for one in arrays:
        size = one.size * one.array.dtype.itemsize
        if size > LARGEST_IN_MATLAB:
            raise OutputError(
                f"{one.name} has {size / 2**30:.1f} GiB, more than the 2 GiB that MATLAB's format "
                "holds; choose some samples with --sample, or export to --netcdf"
            )
        values = one.read()
        if values.dtype.kind == "T":
            values = np.array(values.tolist(), dtype=object)
        elif values.ndim == 1:
            values = values[:, None]  # a column, as MATLAB thinks of them
        _place(content, one.group)[_identifier(one.name)] = values
        if attributes := _attributes(one.array.attrs.asdict()):
            _place(told, one.group)[_identifier(one.name)] = attributes
    about = {_identifier(key): value for key, value in _attributes(root.attrs.asdict()).items()}
    content["attributes"] = {**about, "variables": told}
    script = file.with_name(f"{_identifier(f'read_me_{file.stem}')}.m")
    text = _read_me(file, arrays)
    with _new(file, "MATLAB") as part:
        savemat(part, content, do_compression=True, long_field_names=True, appendmat=False)
        if script.is_file() and script.read_bytes() == text.encode():
            with reserved(script):  # of a command that was killed after it: what it left is removed
                pass
        else:
            with _new(script, "MATLAB") as beside:
                beside.write_text(text, encoding="utf-8")
    return len(arrays)


def _read_me(file: Path, arrays: Sequence[StoredArray]) -> str:
    """Write a MATLAB script that explains the variables of a file, and plots one sweep."""
    lines = [
        f"% What {file.name} holds. Time convention exp(+j w t): a delay t is exp(-2j pi f t)."
    ]
    for one in arrays:
        names = [*one.group.split("/")] if one.group else []
        place = ".".join([*names, _identifier(one.name)])
        told = one.array.attrs.asdict()
        about = " ".join(str(told[key]) for key in ("long_name", "units") if told.get(key))
        size = " x ".join(map(str, one.dimensions)) or "scalar"
        lines.append(f"%   {place:<32} {size}{f': {about}' if about else ''}")
    quoted = file.name.replace("'", "''")
    lines.append(f"m = load('{quoted}');")
    for name in ("echo", "uplink"):
        found = [one for one in arrays if not one.group and one.name == name]
        if not found:
            continue
        first = ", ".join(["1"] * (len(found[0].dimensions) - 1) + [":"])
        lines += [
            f"sweep = m.{name}({first});",
            "plot(m.frequency / 1e9, 20 * log10(abs(sweep(:))));",
            "xlabel('frequency [GHz]'); ylabel('S-parameter [dB]');",
        ]
        break
    return "\n".join(lines) + "\n"


def _opened(store: Path) -> zarr.Group:
    guarded = opened_store(store)
    with damage_told(store):
        return zarr.open_group(guarded, mode="r")


def _arrays(root: zarr.Group, store: Path, samples: Sequence[int] | None) -> list[StoredArray]:
    with damage_told(store):
        members = root.members(max_depth=None)
    found: list[StoredArray] = []
    for path, array in members:
        if not isinstance(array, zarr.Array):
            continue
        if len(found) == MOST_ARRAYS:
            raise MeasurementError(f"{store}: more than {MOST_ARRAYS} arrays; is it a measurement?")
        group, _, name = path.rpartition("/")
        names = getattr(array.metadata, "dimension_names", None) or ()
        dimensions = tuple(str(one) for one in names)
        if len(dimensions) != array.ndim:
            raise MeasurementError(f"{store}: {shortened(repr(path))} does not name its dimensions")
        chosen: Sequence[int] | None = None
        if dimensions[:1] == ("sample",):
            count = array.shape[0]
            chosen = range(count) if samples is None else list(samples)
            for sample in chosen if samples is not None else ():
                if not 0 <= sample < count:
                    raise MeasurementError(
                        f"{store}: sample {sample} of {count}; it must be 0…{count - 1}"
                    )
        found.append(
            StoredArray(
                store=store,
                group=group,
                name=name,
                array=array,
                dimensions=dimensions,
                samples=chosen,
            )
        )
    if samples is not None and all(one.samples is None for one in found):
        raise MeasurementError(f"{store}: no 'sample' dimension; leave --sample out")
    return sorted(found, key=lambda one: (one.group, one.name))


@contextmanager
def _new(file: Path, kind: str) -> Iterator[Path]:
    """Yield a temporary path, which is renamed to ``file`` once it is complete."""
    with new_file(file) as part:
        try:
            yield part
        except (MeasurementError, OutputError):
            raise
        except OSError as error:
            if error.errno is not None and error.errno > 0:
                raise
            raise _unfit(file, kind, error) from error  # the library's own number, below 0
        except (ValueError, TypeError, RuntimeError, LookupError, AttributeError) as error:
            # What a name, a type or a shape of a foreign store is to the library that writes it.
            raise _unfit(file, kind, error) from error


def _unfit(file: Path, kind: str, error: Exception) -> OutputError:
    return OutputError(
        f"{file}: {kind} cannot hold what is in the store ({shortened(str(error))}); export to "
        "the other format, or rename or leave out what it names"
    )


def _attributes(attributes: dict[str, Any]) -> dict[str, Any]:
    plain = (str, int, float, list)
    return {
        key: value
        for key, value in attributes.items()
        # What begins with an underscore is a library's own, such as xarray's _FillValue.
        if isinstance(value, plain) and not isinstance(value, bool) and not key.startswith("_")
    }


def _plain(values: np.ndarray) -> np.ndarray:
    return np.array(values.tolist(), dtype=object) if values.dtype.kind == "T" else values


def _place(content: dict[str, Any], group: str) -> dict[str, Any]:
    for part in group.split("/") if group else ():
        content = content.setdefault(part, {})
    return content


def _identifier(name: str) -> str:
    """Make a name that MATLAB takes: letters, digits and underscores, a letter first."""
    plain = re.sub(r"\W", "_", name)
    return (plain if plain[:1].isalpha() else f"x{plain}")[:63]
