"""Scores of predictions: metrics with intervals, over all samples and by difficulty."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mmslam.benchmark import find_mirrors, locate_user, predict_channel
from mmslam.benchmark.bootstrap import CONFIDENCE, RESAMPLES, Metric
from mmslam.benchmark.recipe import Recipe, load_recipe, space_of
from mmslam.benchmark.truth import SampleTruth, part_truth, true_channels
from simulator.dataset.provenance import code_digest, package_versions


def score(
    track: str, predictions: Path, *, part: str = "test", size: int | None = None
) -> dict[str, Any]:
    """Score a file of predictions; the truth is made from the recipe.

    Parameters
    ----------
    track, part
        What was predicted.
    predictions
        A CSV or Parquet file.
    size
        Of the part, if not the recipe's.

    Returns
    -------
    Recipe, version, digest, and by metric its value with the ends of its 95 % interval: over all
    samples, and over those of each difficulty.

    Raises
    ------
    ScenarioError, MeasurementError
        If there is no such track or part, or the file is wrong.
    """
    recipe = load_recipe(track)
    samples = space_of(recipe, part, size).variations.samples
    if track == "channel":
        shape = _array_shape(recipe, part, size)
        predicted: Any = predict_channel.read(predictions, samples, recipe, shape)
        truth = part_truth(recipe, part, size)
        channels = true_channels(recipe, part, size)
        return _document(
            recipe,
            part,
            truth,
            lambda some: predict_channel.metrics(predicted[some], channels[some]),
        )
    if track == "mirrors":
        segments = find_mirrors.read(predictions, samples)
        truth = part_truth(recipe, part, size)
        return _document(
            recipe,
            part,
            truth,
            lambda some: find_mirrors.metrics(
                [segments[at] for at in some], [truth[at] for at in some]
            ),
        )
    places = locate_user.read(predictions, samples)
    truth = part_truth(recipe, part, size)
    return _document(
        recipe,
        part,
        truth,
        lambda some: locate_user.metrics(places[some], [truth[at] for at in some]),
    )


def lines(document: dict[str, Any]) -> list[str]:
    """Return the lines that show a score."""
    found = [
        f"{document['benchmark']} {document['version']}, {document['part']}: "
        f"{document['samples']} samples"
    ]
    found += [f"  {name:<22} {_shown(one)}" for name, one in document["metrics"].items()]
    for what, kinds in document["by"].items():
        for kind, held in kinds.items():
            name, one = next(iter(held["metrics"].items()))
            place = f"{what} {kind} ({held['samples']})"
            found.append(f"  {place:<22} {name} {_shown(one)}")
    return found


def _shown(one: dict[str, Any]) -> str:
    unit = "" if one["unit"] == "1" else f" {one['unit']}"
    value, low, high = (
        "∞" if one[key] is None else f"{one[key]:.3g}" for key in ("value", "low", "high")
    )
    if one["low"] is None and one["value"] is not None:
        return f"{value}{unit}"  # one sample alone, or nothing to draw again
    return f"{value}{unit}  ({low} … {high})"


def _document(
    recipe: Recipe, part: str, truth: Sequence[SampleTruth], metrics: Any
) -> dict[str, Any]:
    def told(some: np.ndarray) -> dict[str, Any]:
        found: dict[str, Metric] = metrics(some)
        return {name: one.document() for name, one in found.items()}

    by: dict[str, dict[str, Any]] = {}
    for what in truth[0].difficulty:
        kinds = np.array([one.difficulty[what] for one in truth])
        if len(np.unique(kinds)) > 1:
            by[what] = {
                str(kind): {
                    "samples": int(np.sum(kinds == kind)),
                    "metrics": told(np.flatnonzero(kinds == kind)),
                }
                for kind in np.unique(kinds)
            }
    return {
        "benchmark": recipe.name,
        "version": recipe.version,
        "recipe": recipe.digest,
        "part": part,
        "samples": len(truth),
        "interval": {"confidence": CONFIDENCE, "resamples": RESAMPLES},
        "metrics": told(np.arange(len(truth))),
        "by": by,
        "versions": package_versions(),
        "code": code_digest(),
    }


def _array_shape(recipe: Recipe, part: str, size: int | None) -> tuple[int, int]:
    shape: tuple[int, int] = space_of(recipe, part, size).most()
    return shape
