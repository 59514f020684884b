"""The measurement file: an xarray Dataset in Zarr v3, the truth (if any) in a group of it.

Layout (dimensions in brackets)::

    echo [position, frequency]            complex S-parameter
    uplink [user, element, frequency]     complex S-parameter
    aperture_position [position, axis]    m
    element_position [element, axis]      m
    frequency [frequency]                 Hz
    user [user]                           labels
    truth/                                never opened here for an estimate
"""

import shutil
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

from estimator.measurement import Echo, Measurement, MeasurementError, Uplink

FORMAT = 1


def measurement_to_dataset(measurement: Measurement) -> xr.Dataset:
    """Lay a measurement out as the file's root group (complex128, metres, hertz)."""
    variables: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}
    sparameter = {"units": "1", "long_name": "S-parameter"}
    if echo := measurement.echo:
        variables["echo"] = (("position", "frequency"), echo.samples, sparameter)
        variables["aperture_position"] = (("position", "axis"), echo.positions, {"units": "m"})
        frequencies = echo.frequencies
    if measurement.uplinks:
        first = measurement.uplinks[0]
        samples = np.stack([uplink.samples for uplink in measurement.uplinks])
        variables["uplink"] = (("user", "element", "frequency"), samples, sparameter)
        variables["element_position"] = (("element", "axis"), first.positions, {"units": "m"})
        frequencies = first.frequencies
    # Variable-length strings: the fixed-length kind has no specification in Zarr v3.
    labels = np.array([uplink.user for uplink in measurement.uplinks], dtype=np.dtypes.StringDType())
    coordinates = {
        "frequency": ("frequency", frequencies, {"units": "Hz"}),
        "axis": ("axis", np.array(["x", "y", "z"], dtype=np.dtypes.StringDType())),
    }
    if measurement.uplinks:
        coordinates["user"] = ("user", labels)
    dataset = xr.Dataset(variables, coordinates)
    dataset.attrs = {
        "mmslam_format": FORMAT,
        "conventions": "exp(+j omega t): a delay tau appears as exp(-j 2 pi f tau); metres; "
        "x along the array, y boresight, z up",
        "waves": measurement.waves,
        "boresight": measurement.boresight.tolist(),
    }
    optional = {
        "clock_offset_s": measurement.clock_offset,
        "scenario": measurement.scenario,
        "seed": measurement.seed,
    }
    dataset.attrs |= {key: value for key, value in optional.items() if value is not None}
    return dataset
