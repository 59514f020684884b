"""Track *channel*: a channel that was never measured, from the echo and the user's position."""

from pathlib import Path

import numpy as np
from jaxtyping import Complex

from estimator.measurement.model import MeasurementError
from mmslam.benchmark.bootstrap import Metric, metric, quantile
from mmslam.benchmark.prediction_table import read_predictions, refuse_missing
from mmslam.benchmark.recipe import Recipe
from mmslam.benchmark.truth import grid

COLUMNS = ("re", "im")

Channels = Complex[np.ndarray, "samples elements freqs"]


def read(path: Path, samples: int, recipe: Recipe, shape: tuple[int, int]) -> np.ndarray:
    """Read predicted channels: a row for each sample, element and frequency of the grid.

    Parameters
    ----------
    path, samples, recipe
        The file, and the track.
    shape
        Elements and frequencies of the part's arrays, whose indices the file gives.

    Raises
    ------
    MeasurementError
        If the file is wrong.
    """
    keys = ("sample", "element", "frequency")
    rows, columns = grid(recipe, *shape)
    wanted = samples * len(rows) * len(columns)
    table = read_predictions(path, keys=keys, values=COLUMNS, samples=samples, rows=wanted)
    refuse_missing(path, table, samples)
    for name, known in (("element", rows), ("frequency", columns)):
        stray = table[~table[name].isin(known)]
        if len(stray):
            raise MeasurementError(
                f"{path}: {name} {int(stray[name].iloc[0])} is not asked for; the indices are "
                f"{', '.join(map(str, known))}"
            )
    if len(table) != wanted:
        raise MeasurementError(
            f"{path}: {len(table)} rows, but {samples} samples of {len(rows)} elements and "
            f"{len(columns)} frequencies are {wanted}; give a row for each"
        )
    parts = table[list(COLUMNS)].to_numpy(dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(parts).all(axis=-1))
    if bad.size:
        place = ", ".join(f"{name} {table[name].iloc[bad[0]]}" for name in keys)
        raise MeasurementError(f"{path}: {place}: re or im is no finite number; give one")
    values: np.ndarray = (parts[:, 0] + 1j * parts[:, 1]).reshape(samples, len(rows), len(columns))
    loud = float(np.abs(values).max())
    if loud > 1:
        raise MeasurementError(
            f"{path}: a channel of {loud:.3g}: channels are S-parameters, received over "
            "transmitted wave, far below 1; are these decibels, or normalised? Give re and im as "
            "in `uplink`"
        )
    return values


def metrics(predicted: Channels, truth: Channels) -> dict[str, Metric]:
    """Return how alike the channels are: with their phase, without, and in level."""
    power = (np.abs(truth) ** 2).sum(axis=(1, 2))
    mine = (np.abs(predicted) ** 2).sum(axis=(1, 2))
    product = np.abs((truth.conj() * predicted).sum(axis=(1, 2)))
    error = (np.abs(predicted - truth) ** 2).sum(axis=(1, 2))
    silent = mine == 0  # its level is 0: it errs without bound
    with np.errstate(divide="ignore", invalid="ignore"):
        alike = np.where(silent, 0.0, product / np.sqrt(power * mine))
        level = np.where(silent, np.inf, np.abs(10 * np.log10(mine / power)))
    median = quantile(0.5)
    return {
        "median similarity": metric(median, alike, unit="1"),
        "mean similarity": metric(_mean, alike, unit="1"),
        "median NMSE": metric(median, 10 * np.log10(error / power + 1e-12), unit="dB"),
        "median level error": metric(median, level, unit="dB"),
    }


def _mean(values: np.ndarray) -> float:
    return float(values.mean())
