"""Reference rows of the benchmark's tables: our estimator, simpler methods, and chance.

Of the other localization methods in :mod:`validation.baselines` only the single array works with
what a part holds; the rest need further anchors, another band or a survey.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.array.array_frame import array_frame
from estimator.channel.relax import extract_paths
from estimator.geometry.wall_2d import Wall
from estimator.measurement.model import MeasurementError
from estimator.prediction.channel_2d import predict_channel
from mmslam.benchmark.find_mirrors import COLUMNS as MIRRORS
from mmslam.benchmark.locate_user import COLUMNS as USER
from mmslam.benchmark.predict_channel import COLUMNS as CHANNEL
from mmslam.benchmark.recipe import Recipe, load_recipe
from mmslam.benchmark.truth import grid, part_truth
from mmslam.location import locate
from mmslam.measurement import Measurement
from mmslam.measurement_files import read
from mmslam.output import new_file

METHODS = {
    "mirrors": ("estimator", "chance"),
    "user": ("estimator", "single_array", "chance"),
    "channel": ("estimator", "direct"),
}
"""By track."""

Row = tuple[int | float, ...]

CHANCE_MIRROR = 0.4
"""Length of the mirror that chance predicts: that of the recipe's wall. [m]"""


def predict(
    track: str,
    store: Path,
    file: Path,
    *,
    method: str = "estimator",
    tell: Callable[[int, int], None] | None = None,
) -> int:
    """Predict a part by a reference method, and write the file that is scored.

    Parameters
    ----------
    track
        Which one.
    store
        The part, as it was made.
    file
        The CSV file to write.
    method
        One of :data:`METHODS`.
    tell
        Called with the samples done and in all.

    Returns
    -------
    The number of rows.

    Raises
    ------
    MeasurementError
        If there is no such method, or the store is of another track.
    OutputError
        If the file exists or cannot be written.
    """
    recipe = load_recipe(track)
    if method not in METHODS[track]:
        raise MeasurementError(
            f"method = {method!r}: give one of {', '.join(METHODS[track])} for track {track}"
        )
    if file.suffix != ".csv":
        raise MeasurementError(f"{file}: predictions are written as .csv; rename it")
    attributes = zarr.open_group(store, mode="r").attrs.asdict() if store.is_dir() else {}
    if attributes.get("benchmark") != track:
        raise MeasurementError(
            f"{store}: no part of track {track}; make one by `mmslam benchmark make {track}`"
        )
    count = int(str(attributes["samples"]))
    known = _training_means(recipe) if method == "chance" else {}
    head = {
        "mirrors": ("sample", *MIRRORS),
        "user": ("sample", *USER, "found"),
        "channel": ("sample", "element", "frequency", *CHANNEL),
    }[track]
    rows: list[Row] = []
    with new_file(file) as part:
        for sample in range(count):
            if method == "chance":
                rows += [(sample, *known[track])]
            else:
                measurement = read(store, sample=sample)
                rows += _ANSWERS[track](recipe, store, sample, measurement, method)
            if tell is not None:
                tell(sample + 1, count)
        text = ",".join(head) + "\n"
        text += "".join(",".join(_number(value) for value in row) + "\n" for row in rows)
        part.write_text(text, encoding="utf-8")
    return len(rows)


def _number(value: int | float) -> str:
    return repr(value)  # to the last bit


def _training_means(recipe: Recipe) -> dict[str, Row]:
    """Return what is known without any measurement: means over the training part."""
    truth = part_truth(recipe, "train")
    user = np.mean([one.user for one in truth], axis=0)
    wall = np.mean([one.walls[0] for one in truth], axis=0)
    middle, along = wall.mean(axis=0), wall[1] - wall[0]
    half = 0.5 * CHANCE_MIRROR * along / np.linalg.norm(along)
    ends = (*(middle - half).tolist(), *(middle + half).tolist())
    return {"mirrors": ends, "user": (*user.tolist(), 1)}


def _mirrors(
    recipe: Recipe, store: Path, sample: int, measurement: Measurement, method: str
) -> list[Row]:
    estimate = locate(measurement, images=False)
    ends = [(*one.start[:2].tolist(), *one.end[:2].tolist()) for one in estimate.mirrors]
    return [(sample, *one) for one in ends]


def _user(
    recipe: Recipe, store: Path, sample: int, measurement: Measurement, method: str
) -> list[Row]:
    place: Float[np.ndarray, " _"] | None
    if method == "single_array":
        place = _strongest_path(measurement)
    else:
        (user,) = locate(measurement, images=False).users.values()
        place = user.position
    x, y = (0.0, 0.0) if place is None else place[:2].tolist()
    return [(sample, x, y, 0 if place is None else 1)]


def _strongest_path(measurement: Measurement) -> Float[np.ndarray, " 3"] | None:
    """Take the strongest path as direct, as :mod:`validation.baselines.single_array` does."""
    (pilot,) = measurement.uplinks
    frame = array_frame(pilot.positions, measurement.boresight)
    axis, boresight = frame.axes[0], frame.axes[1]
    paths = extract_paths(pilot, most=1, axis=axis, boresight=boresight)
    if not paths:
        return None
    towards = np.cos(paths[0].aoa) * axis + np.sin(paths[0].aoa) * boresight
    place: np.ndarray = frame.origin + paths[0].path_length * towards
    return place


def _channel(
    recipe: Recipe, store: Path, sample: int, measurement: Measurement, method: str
) -> list[Row]:
    assert measurement.echo is not None
    root = zarr.open_group(store, mode="r")
    place = np.asarray(root["user_position"])[sample]
    elements = np.asarray(root["element_position"])
    frequencies = np.asarray(root["frequency"])
    rows, columns = grid(recipe, len(elements), len(frequencies))
    frame = array_frame(elements, measurement.boresight)
    walls = []
    if method == "estimator":
        walls = [
            Wall(
                start=frame.to_local(one.start),
                end=frame.to_local(one.end),
                covariance=one.covariance,
            )
            for one in locate(measurement, images=False).mirrors
        ]
    values = predicted_channel(
        frame.to_local(place), walls, frame.to_local(elements[rows]), frequencies[columns]
    )
    return [
        (sample, int(row), int(column), float(values[i, k].real), float(values[i, k].imag))
        for i, row in enumerate(rows)
        for k, column in enumerate(columns)
    ]


def predicted_channel(
    place: Float[np.ndarray, " 3"],
    walls: list[Wall],
    elements: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, "elements freqs"]:
    """Sum the predicted paths: a spherical wave from each image, reversed by each mirror.

    Parameters
    ----------
    place
        Of the user, in the array's frame. [m]
    walls
        The mirrors found.
    elements, frequencies
        Where the channel is wanted. [m], [Hz]
    """
    middle = float(frequencies.mean())
    paths = predict_channel(place, 1e-8 * np.eye(3), walls, frequency=middle, max_bounces=1)
    found = np.zeros((len(elements), len(frequencies)), dtype=np.complex128)
    for path in paths:
        towards = np.array([np.cos(path.aoa), np.sin(path.aoa), 0.0])
        away = np.linalg.norm(path.path_length * towards - elements, axis=-1)[:, None]
        gain = path.gain * (-1) ** len(path.walls) * path.path_length / away * middle / frequencies
        found += gain * np.exp(-2j * np.pi * frequencies * away / speed_of_light)
    return found


_ANSWERS: dict[str, Any] = {"mirrors": _mirrors, "user": _user, "channel": _channel}
