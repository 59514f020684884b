"""Joins estimator and files for users that move: locate each sample of a dataset, then track."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from zarr.storage import LocalStore

from estimator.localization.pipeline import locate
from estimator.measurement.model import MeasurementError
from estimator.measurement.store import is_store, read_measurement
from estimator.results.estimate import Estimate, Progress, UserEstimate
from estimator.tracking.multi_hypothesis import ACCELERATION, Track, fix, track


@dataclass(frozen=True, kw_only=True)
class MovingUser:
    """One user's answers at all times, and the track through them."""

    name: str
    times: tuple[float, ...]  # [s]
    answers: tuple[UserEstimate, ...]  # one for each time
    track: Track


def track_store(
    path: Path,
    *,
    step: float | None = None,
    acceleration: float = ACCELERATION,
    progress: Progress | None = None,
    located: Callable[[Estimate], None] = lambda estimate: None,
) -> tuple[MovingUser, ...]:
    """Locate and track all users of a dataset whose samples are times.

    Parameters
    ----------
    path
        A store with a leading ``sample`` dimension. A variable ``time`` [sample] in seconds
        says when each sample was measured.
    step
        Time between samples if the store does not say; it goes before what the store says. [s]
    acceleration
        Spectral density, of the motion model. [m²/s³]
    progress
        Told each sample.
    located
        Told each sample's whole estimate.

    Returns
    -------
    The users of the samples, by their names; a sample without a user is one in which it was
    not found.

    Raises
    ------
    MeasurementError
        If the store cannot be read, has no samples, or nobody says when they were measured, or no
        sample holds a pilot.
    """
    if not 0 < acceleration < np.inf:
        raise MeasurementError(
            f"acceleration = {acceleration:g} m²/s³: it must be above 0; somebody who walks has "
            f"about {ACCELERATION:g}"
        )
    times = _times(path, step)
    tell = progress or (lambda stage, done, total: None)
    tell("samples", 0, len(times))
    found: list[dict[str, UserEstimate]] = []
    for sample in range(len(times)):
        estimate = locate(read_measurement(path, sample=sample))
        located(estimate)
        found.append({user.name: user for user in estimate.users})
        tell("samples", sample + 1, len(times))
    users = track_answers(times, found, acceleration=acceleration)
    if not users:
        raise MeasurementError(f"{path}: no sample holds an uplink; a track needs users' pilots")
    return users


def track_answers(
    times: Sequence[float],
    found: Sequence[dict[str, UserEstimate]],
    *,
    acceleration: float = ACCELERATION,
) -> tuple[MovingUser, ...]:
    """Track every user through the answers of successive measurements.

    Parameters
    ----------
    times
        Of the measurements. [s]
    found
        The answers at each of them, by the user's name.
    acceleration
        Spectral density, of the motion model. [m²/s³]
    """
    users = []
    for name in dict.fromkeys(name for answers in found for name in answers):
        missing = UserEstimate(name=name, status="not_found", reason="no pilot at this time")
        answers = tuple(at_one_time.get(name, missing) for at_one_time in found)
        fixes = [fix(time, answer) for time, answer in zip(times, answers, strict=True)]
        way = track(fixes, acceleration=acceleration)
        users.append(MovingUser(name=name, times=tuple(times), answers=answers, track=way))
    return tuple(users)


def _times(path: Path, step: float | None) -> list[float]:
    if not is_store(path):
        raise MeasurementError(
            f"{path}: not a Zarr v3 group (no zarr.json in it); name a dataset with samples"
        )
    with xr.open_zarr(LocalStore(path, read_only=True), consolidated=False, chunks=None) as dataset:
        count = dataset.sizes.get("sample", 0)
        told = dataset["time"].values if "time" in dataset.variables else None
    if count < 2:
        raise MeasurementError(
            f"{path}: a track needs several samples, this store has {max(count, 1)}; "
            "measure at several times, or use `mmslam locate`"
        )
    if step is not None:
        if not 0 < step < np.inf:
            raise MeasurementError(f"step = {step:g} s; the time between samples must be above 0")
        return [step * index for index in range(count)]
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
