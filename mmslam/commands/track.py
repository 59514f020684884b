"""The command ``track``: from a dataset whose samples are times to tracks and their figure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from estimator.measurement import model
from estimator.measurement.guarded_store import damage_told, opened_store
from estimator.measurement.model import MeasurementError
from estimator.measurement.store import PARAMETERS, TRUTH
from estimator.results.estimate import Progress, UserEstimate
from estimator.tracking.multi_hypothesis import ACCELERATION, TrackPoint
from mmslam import output, own_results
from mmslam.location import locate
from mmslam.measurement_files import read
from mmslam.moving_users import MovingUser, track_answers
from mmslam.results.document import plain, to_json, versions
from mmslam.results.tracks import Tracks
from validation.metrics.errors import position_error
from validation.metrics.truth import read_truth

MOST_TIMES = 1_000_000
"""Most samples of a track: a day at ten a second. [-]"""

Truths = Sequence[Mapping[str, Float[np.ndarray, " 3"]]]
"""Where each user truly is at each time; empty where it is not known."""

LEAST_RIVAL = 0.01
"""Probability below which another choice among ambiguous positions is not reported. [-]"""


def track(
    measurements: str | Path | Sequence[model.Measurement],
    *,
    step: float | None = None,
    acceleration: float = ACCELERATION,
    progress: Progress | None = None,
) -> Tracks:
    """Follow users that move: locate them at each time, and join the answers to tracks.

    Parameters
    ----------
    measurements
        A dataset whose samples are times (a variable ``time`` [sample] in seconds says when each
        was measured), or measurements in the order of time.
    step
        Time between measurements; it overrides the dataset's own times, and is required for a
        sequence of measurements. [s]
    acceleration
        Spectral density of the users' acceleration: how freely they move. [m²/s³]
    progress
        Called after each sample.

    Returns
    -------
    The users by their names; a time without a user is one at which it was not found.

    Raises
    ------
    MeasurementError
        If the dataset cannot be read or has no samples, the times of measurement are unknown, or
        no sample holds a pilot.

    Examples
    --------
    >>> import mmslam
    >>> small = {
    ...     "base_station.elements": 48, "radio.stop_ghz": 230.0, "radio.points": 101,
    ...     "objects.wall.centre_m": [0.0, 0.4], "objects.wall.length_m": 0.2,
    ...     "users.user.position_m": [0.5, 0.4],
    ... }
    >>> walk = [
    ...     mmslam.load_scenario("slam_2d", small | {"users.user.position_m": [x, 0.4]})
    ...     for x in (0.48, 0.50, 0.52)
    ... ]
    >>> tracks = mmslam.track([mmslam.simulate(at, seed=1) for at in walk], step=0.05)
    >>> [point.candidate for point in tracks["user"].track.points]
    [0, 0, 0]
    """
    if not 0 < acceleration < np.inf:
        raise MeasurementError(
            f"acceleration = {acceleration:g} m²/s³: it must be above 0; somebody who walks has "
            f"about {ACCELERATION:g}"
        )
    if isinstance(measurements, str | Path):
        path = Path(measurements)
        times = _times(path, step)

        source = f"{path}: "
        series: Iterator[model.Measurement] = (
            read(path, sample=sample) for sample in range(len(times))
        )
    else:
        times = _steps(len(measurements), step)
        source, series = "", iter(measurements)
    tell = progress or (lambda stage, done, total: None)
    tell("samples", 0, len(times))
    found: list[dict[str, UserEstimate]] = []
    for measurement in series:
        estimate = locate(measurement, images=False)
        found.append({user.name: user for user in estimate.users})
        tell("samples", len(found), len(times))
    users = track_answers(times, found, acceleration=acceleration)
    if not users:
        raise MeasurementError(f"{source}no sample holds an uplink; a track needs users' pilots")
    assert estimate.aperture is not None
    return Tracks(users=users, mirrors=estimate.mirrors, aperture=estimate.aperture)


@dataclass(frozen=True, kw_only=True)
class Tracked:
    """What the command has written, and where."""

    folder: Path
    document: Mapping[str, Any]


def track_to_folder(
    path: Path,
    *,
    folder: Path | None,
    step: float | None,
    acceleration: float | None,
    progress: Progress | None = None,
) -> Tracked:
    """Locate and track all users of a dataset whose samples are times, and write what was found.

    Parameters
    ----------
    path
        The dataset.
    folder
        Is replaced as a whole once all is done; refused before any work if it is foreign.
        None: ``out/NAME-track``.
    step
        Time between samples, before what the file says. [s]
    acceleration
        Spectral density, of the motion model; None: that of somebody who walks. [m²/s³]
    progress
        Told each sample.
    """
    acceleration = ACCELERATION if acceleration is None else acceleration
    folder = folder or Path("out") / f"{path.stem}-track"
    output.refuse_to_replace_input(folder, path)
    with output.replacing(folder, own_results.refuse_foreign_track) as new:
        new.mkdir()
        tracks = track(path, step=step, acceleration=acceleration, progress=progress)
        users = tracks.users
        truths = [
            read_truth(path, sample=sample).user_position for sample in range(len(users[0].times))
        ]
        document = track_document(users, truths, acceleration=acceleration)
        # matplotlib's import takes half a second that other commands need not wait.
        from mmslam.results.page.single_file import can_draw, render_page
        from mmslam.results.page.tracks import SCRIPTS_TRACK, tracks_document
        from mmslam.results.pictures_2d import save
        from mmslam.results.track_figure import track_figure

        figure = track_figure(users, truths, tracks.mirrors, tracks.aperture)
        save(figure, new / own_results.TRACK_FIGURE)
        if can_draw():
            shown = tracks_document(users, truths, tracks.mirrors, tracks.aperture)
            page = render_page("track.html.j2", shown, SCRIPTS_TRACK)
            (new / own_results.TRACK_PAGE).write_text(page, encoding="utf-8")
        (new / own_results.TRACK).write_text(to_json(document), encoding="utf-8")
    return Tracked(folder=folder, document=document)


def track_document(
    users: Sequence[MovingUser], truths: Truths, *, acceleration: float
) -> Mapping[str, Any]:
    """Lay out the tracks as one JSON document: SI, null where unknown.

    Parameters
    ----------
    users
        Tracked through the same times.
    truths
        Of each time.
    acceleration
        Of the motion model. [m²/s³]
    """
    return plain(
        {
            "format": own_results.FORMAT,
            "versions": versions(),
            "acceleration_m2_s3": acceleration,
            "tracks": [_track(user, truths) for user in users],
        }
    )


def track_lines(document: Mapping[str, Any], folder: Path) -> Iterator[str]:
    """Tell the tracks: a line for each time of each user, and where the files lie."""
    for one in document["tracks"]:
        points = {point["time_s"]: point for point in one["points"]}
        for fix in one["fixes"]:
            yield f"{one['name']} at {fix['time_s']:.3f} s: {_told(fix, points.get(fix['time_s']))}"
        if one["rival"] > LEAST_RIVAL:
            yield (
                f"{one['name']}: another choice among ambiguous answers is "
                f"{100 * one['rival']:.0f} % as probable"
            )
    page = folder / own_results.TRACK_PAGE
    yield f"open {page if page.exists() else folder / own_results.TRACK_FIGURE}"


def _told(fix: Mapping[str, Any], point: Mapping[str, Any] | None) -> str:
    status = fix["status"].replace("_", " ")
    if point is None:
        return f"{status}; before the track begins"
    place = ", ".join(f"{value:.4f}" for value in point["position_m"])
    spread = sqrt(sum(point["covariance"][axis][axis] for axis in range(3)))
    speed = sqrt(sum(value**2 for value in point["velocity_m_s"]))
    basis = "bridged" if point["candidate"] is None else status
    if point["candidate"]:
        basis += f", alternative {point['candidate']} taken"
    line = f"({place}) m ± {1e3 * spread:.2f} mm, {speed:.2f} m/s ({basis})"
    if point["error_m"] is not None:
        line += f"; {1e3 * point['error_m']:.2f} mm from the truth"
    return line


def _track(user: MovingUser, truths: Truths) -> dict[str, Any]:
    at = {time: truth.get(user.name) for time, truth in zip(user.times, truths, strict=True)}
    return {
        "name": user.name,
        "rival": user.track.rival,
        "points": [_point(point, at[point.time]) for point in user.track.points],
        "fixes": [
            {
                "time_s": time,
                "status": answer.status,
                "reason": answer.reason,
                "estimate_m": answer.position,
                "covariance_m2": answer.covariance,
                "error_m": position_error(answer.position, at[time]),
                "alternatives_m": [other.position for other in answer.alternatives],
            }
            for time, answer in zip(user.times, user.answers, strict=True)
        ],
    }


def _point(point: TrackPoint, truth: Float[np.ndarray, " 3"] | None) -> dict[str, Any]:
    return {
        "time_s": point.time,
        "position_m": point.position,
        "velocity_m_s": point.velocity,
        "covariance": point.covariance,  # of (position [m], velocity [m/s])
        "candidate": point.candidate,  # 0: the answer, above: an alternative, null: bridged
        "truth_m": truth,
        "error_m": position_error(point.position, truth),
    }


def _times(path: Path, step: float | None) -> list[float]:
    store = opened_store(path, hidden=(TRUTH, PARAMETERS))
    with damage_told(path), xr.open_zarr(store, consolidated=False, chunks=None) as dataset:
        count = dataset.sizes.get("sample", 0)
        if count > MOST_TIMES:
            raise MeasurementError(
                f"{path}: {count} samples, more than {MOST_TIMES}; track them in parts"
            )
        told = dataset["time"].values if "time" in dataset.variables else None
        if told is not None and told.dtype.kind not in "iuf":
            raise MeasurementError(
                f"{path}: 'time' has type {told.dtype}; it must be numbers, in seconds"
            )
    if count < 2:
        raise MeasurementError(
            f"{path}: a track needs several samples, this store has {max(count, 1)}; "
            "measure at several times, or use `mmslam locate`"
        )
    if step is not None:
        return _steps(count, step)
    if told is None:
        raise MeasurementError(
            f"{path}: no variable 'time' says when the samples were measured; give the step"
        )
    if told.shape != (count,) or not np.all(np.diff(told.astype(float)) > 0):
        raise MeasurementError(
            f"{path}: 'time' has shape {told.shape} or does not increase; it must be one time in "
            f"seconds for each of the {count} samples, in order"
        )
    return [float(time) for time in told]


def _steps(count: int, step: float | None) -> list[float]:
    if step is None:
        raise MeasurementError("nothing says when the measurements were made; give the step")
    if not 0 < step < np.inf:
        raise MeasurementError(f"step = {step:g} s; the time between samples must be above 0")
    if count < 2:
        raise MeasurementError(f"a track needs several measurements, there is {count}")
    return [step * index for index in range(count)]
