"""Track *mirrors*: where the flat walls are, from the echo alone."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from estimator.measurement.model import MeasurementError
from mmslam.benchmark.bootstrap import Metric, metric
from mmslam.benchmark.prediction_table import read_predictions, refuse_wild
from mmslam.benchmark.truth import SampleTruth
from validation.metrics.errors import distances_from_segment
from validation.metrics.mirror_check import ON_WALL, SHARE_ON_WALL, TURNED

COLUMNS = ("x1_m", "y1_m", "x2_m", "y2_m")
PLACES = 41
"""Points of a predicted segment that are compared with the walls. [-]"""

SEGMENTS = 100
"""Most segments that are read of a sample, on average: its rooms have a few walls. [-]"""

Counts = Float[np.ndarray, "samples 4"]
"""Of each sample: walls, walls found, segments, segments that are right."""


def read(path: Path, samples: int) -> list[Float[np.ndarray, "segments 2 2"]]:
    """Read predicted segments, a row each; a sample without a row has none.

    Raises
    ------
    MeasurementError
        If the file is wrong, or a segment has no length.
    """
    table = read_predictions(
        path,
        keys=("sample",),
        values=COLUMNS,
        samples=samples,
        rows=SEGMENTS * samples,
        once=False,
    )
    refuse_wild(path, table, COLUMNS)
    ends = table[list(COLUMNS)].to_numpy(dtype=np.float64).reshape(-1, 2, 2)
    numbers = table["sample"].to_numpy()
    points = np.flatnonzero(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1) < 1e-6)
    if points.size:
        raise MeasurementError(
            f"{path}: sample {numbers[points[0]]}: a mirror from a point to itself has no "
            "direction; give its two ends"
        )
    return [ends[numbers == sample] for sample in range(samples)]


def metrics(
    predicted: Sequence[Float[np.ndarray, "_ 2 2"]], truth: Sequence[SampleTruth]
) -> dict[str, Metric]:
    """Return precision, recall, F1, and the errors of the right segments."""
    compared = [_compare(one, true.walls) for one, true in zip(predicted, truth, strict=True)]
    counts = np.array([one[0] for one in compared], dtype=np.float64)
    walls, found, segments, right = counts.T
    angles = np.array([one[1] for one in compared])
    offsets = np.array([one[2] for one in compared])
    return {
        "F1": metric(_f1, walls, found, segments, right, unit="1"),
        "precision": metric(_ratio, right, segments, unit="1"),
        "recall": metric(_ratio, found, walls, unit="1"),
        "median angle error": metric(_median, np.degrees(angles), unit="°"),
        "median offset error": metric(_median, 1e3 * offsets, unit="mm"),
    }


def _compare(
    segments: Float[np.ndarray, "_ 2 2"], walls: Float[np.ndarray, "_ 2 2"]
) -> tuple[tuple[int, int, int, int], float, float]:
    """Count what is right in one sample, with the median errors of that; NaN without."""
    flat = np.zeros((len(walls), 2, 3))
    flat[:, :, :2] = walls
    found: set[int] = set()
    angles, offsets = [], []
    for start, end in segments:
        places = np.zeros((PLACES, 3))
        places[:, :2] = np.linspace(start, end, PLACES)
        away = [distances_from_segment(places, one[0], one[1]) for one in flat]
        nearest = int(np.argmin([one.mean() for one in away]))
        on_walls = np.mean(np.min(away, axis=0) < ON_WALL)
        along = walls[nearest, 1] - walls[nearest, 0]
        mine = end - start
        angle = float(np.arctan2(abs(along[0] * mine[1] - along[1] * mine[0]), abs(along @ mine)))
        if on_walls < SHARE_ON_WALL or angle > TURNED:
            continue
        found.add(nearest)
        middle = walls[nearest].mean(axis=0) - start
        offset = abs(mine[0] * middle[1] - mine[1] * middle[0]) / np.linalg.norm(mine)
        angles.append(angle)
        offsets.append(float(offset))
    told = (len(walls), len(found), len(segments), len(angles))
    if not angles:
        return told, np.nan, np.nan
    return told, float(np.median(angles)), float(np.median(offsets))


def _ratio(part: np.ndarray, of: np.ndarray) -> float:
    return float(part.sum() / of.sum()) if of.sum() else float("nan")


def _f1(walls: np.ndarray, found: np.ndarray, segments: np.ndarray, right: np.ndarray) -> float:
    precision, recall = _ratio(right, segments), _ratio(found, walls)
    if not precision + recall > 0:
        return 0.0
    return 2 * precision * recall / (precision + recall)


def _median(values: np.ndarray) -> float:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if known.size else float("nan")
