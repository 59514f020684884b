"""Measurement files: read and written."""

from pathlib import Path

from estimator.measurement.store import read_measurement, write_measurement
from mmslam import output, own_results
from mmslam.measurement import Measurement, TruthFile


def read(path: str | Path, *, sample: int | None = None) -> Measurement:
    """Read a measurement file, or one sample of a dataset.

    Parameters
    ----------
    path
        The store.
    sample
        Which one, if the store is a dataset.

    Returns
    -------
    The measurement. Its truth, if the store holds any, is opened when it is first asked for.

    Raises
    ------
    MeasurementError
        If the store is missing, foreign or damaged; the message says what and where.

    Examples
    --------
    >>> import mmslam
    >>> room = mmslam.load_scenario(
    ...     "point_scatterers", {"base_station.elements": 16, "radio.points": 16}
    ... )
    >>> mmslam.write("room.zarr", mmslam.simulate(room, seed=1))
    >>> mmslam.read("room.zarr")
    point_scatterers, seed 1: echo
    positions    16 over 7.5 mm
    frequencies  16 from 220 to 295 GHz
    clock        shared
    truth        beside it
    """
    measurement = read_measurement(Path(path), sample=sample)
    return Measurement.of(measurement, beside=TruthFile(store=Path(path), sample=sample))


def write(path: str | Path, measurement: Measurement) -> None:
    """Write a measurement to a file, and beside it the truth, if it is known.

    Parameters
    ----------
    path
        The store; an earlier one is replaced, anything else refused.
    measurement
        What is written.

    Raises
    ------
    OutputError
        If something else is at ``path``, or it cannot be written; nothing is left behind then.

    Examples
    --------
    >>> import numpy as np
    >>> import mmslam
    >>> own = mmslam.Measurement.from_arrays(
    ...     frequencies=np.linspace(220e9, 221e9, 5),
    ...     positions=np.arange(4) * 0.5e-3,
    ...     echo=np.ones((4, 5)),
    ... )
    >>> mmslam.write("own.zarr", own)
    >>> mmslam.read("own.zarr").echo.samples.shape
    (4, 5)
    """
    with output.replacing(Path(path), own_results.refuse_foreign_store) as new:
        proper = measurement.without_truth()
        write_measurement(new, proper, truth=measurement.truth_dataset)
