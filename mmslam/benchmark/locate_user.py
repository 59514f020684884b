"""Track *user*: where the user is that is heard over a wall, from echo and pilot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from mmslam.benchmark.bootstrap import Metric, metric, quantile
from mmslam.benchmark.prediction_table import read_predictions, refuse_missing, refuse_wild
from mmslam.benchmark.truth import SampleTruth

COLUMNS = ("x_m", "y_m")
NEAR = (0.01, 0.1)
"""Errors of which the shares are told. [m]"""


def read(path: Path, samples: int) -> Float[np.ndarray, "samples 2"]:
    """Read predicted positions: NaN where the file says that the user was not found.

    Raises
    ------
    MeasurementError
        If the file is wrong.
    """
    table = read_predictions(
        path,
        keys=("sample",),
        values=COLUMNS,
        optional=("found",),
        samples=samples,
        rows=samples,
    )
    refuse_missing(path, table, samples)
    absent = np.zeros(samples, dtype=bool)
    if "found" in table.columns:
        absent = table["found"].to_numpy() == 0
        table.loc[absent, list(COLUMNS)] = 0.0  # whatever stands there
    refuse_wild(path, table, COLUMNS)
    places: np.ndarray = table[list(COLUMNS)].to_numpy(dtype=np.float64, copy=True)
    places[absent] = np.nan
    return places


def metrics(
    predicted: Float[np.ndarray, "samples 2"], truth: Sequence[SampleTruth]
) -> dict[str, Metric]:
    """Return quantiles of the error and shares; a user who is not found errs without bound."""
    errors = np.linalg.norm(predicted - np.array([one.user for one in truth]), axis=-1)
    errors[np.isnan(errors)] = np.inf
    found = {
        "median error": metric(quantile(0.5), 1e3 * errors, unit="mm"),
        "90 % error": metric(quantile(0.9), 1e3 * errors, unit="mm"),
    }
    for near in NEAR:
        found[f"within {1e3 * near:g} mm"] = metric(_share, 1.0 * (errors <= near), unit="1")
    found["found"] = metric(_share, 1.0 * np.isfinite(errors), unit="1")
    return found


def _share(values: np.ndarray) -> float:
    return float(values.mean())
