"""The measurement file: an xarray Dataset in Zarr v3, the truth (if any) in a group of it.

Layout (dimensions in brackets)::

    echo [position, frequency]            complex S-parameter
    uplink [user, element, frequency]     complex S-parameter
    aperture_position [position, axis]    m, of the receiver
    transmit_position [position, axis]    m, where the transmitter stands apart
    element_position [element, axis]      m
    frequency [frequency]                 Hz
    user [user]                           labels
    path_… [path], [path_list]            lists of paths, see :mod:`.path_list_store`
    truth/                                never opened here for an estimate

A dataset has a leading dimension ``sample``. What differs in length between its samples is
padded with NaN; ``position_count`` and ``frequency_count`` say how much of a sample counts,
``echo_present`` and ``uplink_present [user]`` what was received at all, and ``status`` whether
the sample could be made. What is the same in all samples has no such dimension.
"""

import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import xarray as xr

from estimator.measurement.atomic_rename import exchange, rename_new
from estimator.measurement.guarded_store import (
    MOST_VALUES,
    damage_told,
    is_store,
    opened_store,
    shortened,
)
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.measurement.path_list_store import LISTS, path_list_variables, read_path_lists
from estimator.measurement.store_attributes import (
    AIR_VARIABLES,
    air_attributes,
    finite_number,
    read_air,
    unit_boresight,
    whole_seed,
)

FORMAT = 1

TRUTH = "truth"
"""Group that holds what only a comparison may know."""

PARAMETERS = "parameters"
"""Group of a dataset that holds what was drawn for each sample; a part of the truth, too."""

CONVENTIONS = (
    "exp(+j omega t): a delay tau appears as exp(-j 2 pi f tau); metres; "
    "x along the array, y boresight, z up"
)
"""How the numbers of a store are meant."""


__all__ = [
    "CONVENTIONS",
    "FORMAT",
    "PARAMETERS",
    "TRUTH",
    "is_store",
    "measurement_to_dataset",
    "read_measurement",
    "write_measurement",
]


def measurement_to_dataset(measurement: Measurement) -> xr.Dataset:
    """Lay a measurement out as the file's root group (complex128, metres, hertz)."""
    variables: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}
    sparameter = {"units": "1", "long_name": "S-parameter"}
    if echo := measurement.echo:
        variables["echo"] = (("position", "frequency"), echo.samples, sparameter)
        variables["aperture_position"] = (("position", "axis"), echo.positions, {"units": "m"})
        if echo.transmit_positions is not None:
            places = echo.transmit_positions
            variables["transmit_position"] = (("position", "axis"), places, {"units": "m"})
        frequencies = echo.frequencies
    if measurement.uplinks:
        first = measurement.uplinks[0]
        samples = np.stack([uplink.samples for uplink in measurement.uplinks])
        variables["uplink"] = (("user", "element", "frequency"), samples, sparameter)
        variables["element_position"] = (("element", "axis"), first.positions, {"units": "m"})
        frequencies = first.frequencies
    # Variable-length strings: the fixed-length kind has no specification in Zarr v3.
    labels = np.array(
        [uplink.user for uplink in measurement.uplinks], dtype=np.dtypes.StringDType()
    )
    variables |= path_list_variables(measurement.path_lists)
    coordinates: dict[str, tuple[str, np.ndarray, dict[str, str]]] = {
        "axis": ("axis", np.array(["x", "y", "z"], dtype=np.dtypes.StringDType()), {}),
    }
    if measurement.echo or measurement.uplinks:
        coordinates["frequency"] = ("frequency", frequencies, {"units": "Hz"})
    if measurement.uplinks:
        coordinates["user"] = ("user", labels, {})
    dataset = xr.Dataset(variables, coordinates)
    dataset.attrs = {
        "mmslam_format": FORMAT,
        "conventions": CONVENTIONS,
        "waves": measurement.waves,
        "boresight": measurement.boresight.tolist(),
    }
    optional = {
        "clock_offset_s": measurement.clock_offset,
        "scenario": measurement.scenario,
        "seed": measurement.seed,
        "medium_index": measurement.medium_index,
        **air_attributes(measurement.air),
    }
    dataset.attrs |= {key: value for key, value in optional.items() if value is not None}
    return dataset


def write_measurement(
    path: Path, measurement: Measurement, *, truth: xr.Dataset | None = None
) -> None:
    """Write a measurement (and its truth) aside, then rename it into place.

    Parameters
    ----------
    path
        The store's folder; a store that is already there is replaced, anything else refused.
    measurement
        What is stored in the root group.
    truth
        What is stored in the group ``truth``, for comparisons only.

    Raises
    ------
    MeasurementError
        If something else than a Zarr store is at ``path``.
    OSError
        If the folder cannot be written; nothing is left behind then.
    """
    path = Path(path)
    if path.exists() and not is_store(path):
        raise _foreign(path)
    missing = [parent for parent in path.parents if not parent.exists()]
    aside: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(prefix=f".{path.name}-", dir=path.parent))
        _write_group(aside / "new", measurement_to_dataset(measurement), group=None)
        if truth is not None:
            _write_group(aside / "new", truth, group=TRUTH)
        _put_in_place(aside / "new", path)
    finally:
        if aside is not None:
            shutil.rmtree(aside, ignore_errors=True)
        for parent in missing:  # innermost first; the first that is not empty stays
            with suppress(OSError):
                parent.rmdir()


def _put_in_place(new: Path, path: Path) -> None:
    """Exchange a new store for the one that is there, if it is one."""
    with suppress(FileExistsError):
        rename_new(new, path)
        return
    if is_store(path) and exchange(new, path):
        if not is_store(new):  # what had been there, changed in the last instant
            exchange(new, path)
            raise _foreign(path)
        return
    if not is_store(path):
        raise _foreign(path)
    # This system exchanges no names: out with the old one, and back if anything comes between.
    old = new.with_name("old")
    try:
        path.rename(old)
        new.rename(path)
    except BaseException:
        if old.exists():
            old.rename(path)
        raise


def _foreign(path: Path) -> MeasurementError:
    return MeasurementError(
        f"{path} exists and is not a measurement store; move it away or choose another name"
    )


def read_measurement(path: Path, *, sample: int | None = None) -> Measurement:
    """Read a measurement, or one sample of a dataset; the truth is not looked at.

    Parameters
    ----------
    path
        The store's folder.
    sample
        Which one, if the store has a leading ``sample`` dimension.

    Raises
    ------
    MeasurementError
        If the store is missing, foreign or truncated, a variable is missing or has other
        dimensions, or values are not finite.
    """
    path = Path(path)
    store = opened_store(path, hidden=(TRUTH, PARAMETERS))  # opening a group asks what is in it
    with damage_told(path):
        with xr.open_zarr(store, consolidated=False, chunks=None) as lazy:
            if len(lazy.variables) == 0:
                raise MeasurementError(f"{path}: a Zarr group without arrays; nothing to locate")
            dataset = _one_sample(path, lazy, sample).load()
        return _measurement(path, dataset)


def _write_group(store: Path, dataset: xr.Dataset, *, group: str | None) -> None:
    # The fill value is what a missing chunk reads as: NaN, so that it cannot pass as data.
    fills = {"f": float("nan"), "c": complex("nan+nanj")}
    encoding = {
        str(name): {"fill_value": fills[variable.dtype.kind]}
        for name, variable in dataset.variables.items()
        if variable.dtype.kind in fills
    }
    dataset.to_zarr(
        store, group=group, mode="a", zarr_format=3, consolidated=False, encoding=encoding
    )


def _one_sample(path: Path, dataset: xr.Dataset, sample: int | None) -> xr.Dataset:
    count = dataset.sizes.get("sample")
    if count is None:
        if sample is not None:
            raise MeasurementError(f"{path}: no 'sample' dimension; leave --sample out")
        _refuse_too_many(path, dataset)
        return dataset
    if sample is None and count > 1:
        raise MeasurementError(f"{path}: holds {count} samples; choose one, 0…{count - 1}")
    chosen = sample or 0
    if not 0 <= chosen < count:
        raise MeasurementError(f"{path}: sample {chosen} of {count}; it must be 0…{count - 1}")
    one = dataset.isel(sample=chosen)
    _refuse_too_many(path, one)
    return _without_padding(path, chosen, one.load())


def _refuse_too_many(path: Path, dataset: xr.Dataset) -> None:
    count = sum(variable.size for variable in dataset.variables.values())
    if count > MOST_VALUES:
        raise MeasurementError(
            f"{path}: a measurement of {count} values, more than {MOST_VALUES}; thin it out, or "
            "store it in parts"
        )


def _without_padding(path: Path, sample: int, dataset: xr.Dataset) -> xr.Dataset:
    """Take away what a sample of a dataset has no values of.

    The counts are stored apart from what they count: a missing chunk of either is noticed.
    """
    if "status" in dataset and int(dataset["status"]) != 0:
        why = str(dataset["failure"].values) if "failure" in dataset else ""
        raise MeasurementError(
            f"{path}: sample {sample} could not be made ({shortened(why) or 'nobody says why'}); "
            "choose another one, or make it again with `mmslam dataset --retry-failed`"
        )
    for name, dimensions in _COUNTED.items():
        if name not in dataset:
            continue
        count = int(dataset[name])
        for dimension in dimensions & set(map(str, dataset.dims)):
            if not 0 < count <= dataset.sizes[dimension]:
                raise MeasurementError(
                    f"{path}: {name} = {count} of sample {sample}, but there is room for "
                    f"{dataset.sizes[dimension]}; the store may be truncated: write it again"
                )
            dataset = dataset.isel({dimension: slice(0, count)})
    if "echo_present" in dataset and int(dataset["echo_present"]) == 0:
        dataset = dataset.drop_vars("echo", errors="ignore")
    if "uplink_present" in dataset and "uplink" in dataset:
        present = dataset["uplink_present"].values == 1
        if "uplink_count" in dataset and int(dataset["uplink_count"]) != int(present.sum()):
            raise MeasurementError(
                f"{path}: uplink_count = {int(dataset['uplink_count'])} of sample {sample}, but "
                f"{int(present.sum())} users are marked; the store may be truncated: write it again"
            )
        if not present.any():
            return dataset.drop_vars("uplink")
        dataset = dataset.isel(user=np.flatnonzero(present))
    return dataset


_COUNTED = {
    "position_count": {"position", "element"},
    "frequency_count": {"frequency"},
}
"""Dimensions that each count cuts to what a sample has."""


def _measurement(path: Path, dataset: xr.Dataset) -> Measurement:
    attributes = dict(dataset.attrs)
    told = (("boresight", "boresight"), ("clock_offset", "clock_offset_s"), *AIR_VARIABLES)
    for variable, key in told:
        if variable in dataset and np.all(np.isfinite(dataset[variable].values)):
            attributes[key] = dataset[variable].values.tolist()
    version = attributes.get("mmslam_format", FORMAT)
    if version != FORMAT:
        raise MeasurementError(
            f"{path}: format {shortened(repr(version))}, this program reads {FORMAT}; use a "
            "matching version"
        )
    if "echo" not in dataset and "uplink" not in dataset and LISTS not in dataset:
        found = shortened(", ".join(map(str, dataset.data_vars)) or "none")
        raise MeasurementError(f"{path}: neither 'echo' nor 'uplink' is there (found: {found})")
    echo = None
    frequencies = np.zeros(0)
    if "echo" in dataset or "uplink" in dataset:
        frequencies = _array(path, dataset, "frequency", ("frequency",), float)
    if "echo" in dataset:
        echo = Echo(
            samples=_array(path, dataset, "echo", ("position", "frequency"), complex),
            positions=_array(path, dataset, "aperture_position", ("position", "axis"), float),
            frequencies=frequencies,
            transmit_positions=_array(
                path, dataset, "transmit_position", ("position", "axis"), float
            )
            if "transmit_position" in dataset
            else None,
        )
    uplinks: tuple[Uplink, ...] = ()
    if "uplink" in dataset:
        samples = _array(path, dataset, "uplink", ("user", "element", "frequency"), complex)
        positions = _array(path, dataset, "element_position", ("element", "axis"), float)
        labels = dataset["user"].values if "user" in dataset else range(len(samples))
        uplinks = tuple(
            Uplink(samples=pilot, positions=positions, frequencies=frequencies, user=str(label))
            for label, pilot in zip(labels, samples, strict=True)
        )
    waves = attributes.get("waves", "spherical")
    if waves not in ("spherical", "cylindrical"):
        raise MeasurementError(
            f"{path}: waves = {shortened(repr(waves))}; it must be spherical or cylindrical"
        )
    return Measurement(
        echo=echo,
        uplinks=uplinks,
        waves=waves,
        boresight=unit_boresight(path, attributes.get("boresight", [0.0, 1.0, 0.0])),
        clock_offset=finite_number(path, attributes, "clock_offset_s"),
        scenario=None if (name := attributes.get("scenario")) is None else str(name),
        seed=whole_seed(path, attributes),
        path_lists=read_path_lists(path, dataset),
        air=read_air(path, attributes),
        medium_index=finite_number(path, attributes, "medium_index"),
    )


def _array(
    path: Path,
    dataset: xr.Dataset,
    name: str,
    dimensions: tuple[str, ...],
    kind: type[float] | type[complex],
) -> np.ndarray:
    if name not in dataset:
        raise MeasurementError(f"{path}: variable {name!r} is missing; write it {dimensions}")
    variable = dataset[name]
    if set(variable.dims) != set(dimensions):
        raise MeasurementError(
            f"{path}: {name!r} has dimensions {shortened(str(variable.dims))}; they must be "
            f"{dimensions}"
        )
    if variable.dtype.kind not in "iufc" or (kind is float and variable.dtype.kind == "c"):
        raise MeasurementError(
            f"{path}: {name!r} has type {variable.dtype}; it must be {kind.__name__}"
        )
    if dimensions[-1] == "axis" and variable.sizes["axis"] != 3:
        raise MeasurementError(
            f"{path}: {name!r} has {variable.sizes['axis']} coordinates; it needs x, y and z"
        )
    wide = np.complex128 if kind is complex else np.float64
    return np.ascontiguousarray(variable.transpose(*dimensions).values, dtype=wide)
