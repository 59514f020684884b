"""Datasets whose samples are times, from pilots in closed form."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from estimator.measurement.model import Measurement, MeasurementError, Uplink
from estimator.measurement.store import measurement_to_dataset, write_measurement
from estimator.results.estimate import UserEstimate
from mmslam.commands.track import track
from mmslam.moving_users import track_answers
from validation.analytic.point_scatterer import complex_noise, point_uplink

FREQUENCIES = np.linspace(220e9, 295e9, 101)  # 0.4 m of unambiguous path
POSITIONS = np.stack([np.arange(-16, 16) * 0.5e-3, np.zeros(32), np.zeros(32)], axis=1)
STEP = 0.1  # [s]
WAYS = {  # at 0.3 m/s and 0.1 m/s
    "ann": np.array([[0.02 + 0.03 * index, 0.25, 0.0] for index in range(3)]),
    "bob": np.array([[-0.05, 0.20 + 0.01 * index, 0.0] for index in range(3)]),
}


def pilot(place: np.ndarray, user: str, rng: np.random.Generator) -> Uplink:
    clean = point_uplink(place[None], positions=POSITIONS, frequencies=FREQUENCIES, user=user)
    variance = 0.01 * float(np.mean(np.abs(clean.samples) ** 2))  # 20 dB
    return Uplink(
        samples=clean.samples + complex_noise(clean.samples.shape, variance, rng),
        positions=POSITIONS,
        frequencies=FREQUENCIES,
        user=user,
    )


@pytest.fixture(scope="module")
def samples() -> xr.Dataset:
    rng = np.random.default_rng(0)
    measured = [
        measurement_to_dataset(
            Measurement(
                echo=None,
                uplinks=tuple(pilot(way[index], name, rng) for name, way in WAYS.items()),
                clock_offset=0.0,
            )
        )
        for index in range(3)
    ]
    return xr.concat(measured, "sample", data_vars=["uplink"], join="exact")


def written(dataset: xr.Dataset, folder: Path) -> Path:
    dataset.to_zarr(folder / "times.zarr", mode="w", zarr_format=3, consolidated=False)
    return folder / "times.zarr"


def test_two_users_at_once_are_tracked_through_the_samples(
    samples: xr.Dataset, tmp_path: Path
) -> None:
    timed = samples.assign(time=("sample", STEP * np.arange(3)))
    told: list[tuple[str, int, int]] = []
    users = track(written(timed, tmp_path), progress=lambda *step: told.append(step))
    assert [user.name for user in users] == ["ann", "bob"]
    assert told == [("samples", done, 3) for done in range(4)]
    for user in users:
        assert user.times == pytest.approx([0.0, 0.1, 0.2])
        for point, place, answer in zip(
            user.track.points, WAYS[user.name], user.answers, strict=True
        ):
            assert answer.position is not None
            off = (point.position - place)[:2]
            # χ² of two coordinates exceeds this once in three million.
            assert off @ np.linalg.solve(point.covariance[:2, :2], off) < 30
        way = WAYS[user.name]
        np.testing.assert_allclose(
            user.track.points[1].velocity, (way[2] - way[0]) / (2 * STEP), atol=0.05
        )


def test_a_user_that_is_away_for_a_time_is_bridged() -> None:
    covariance = 1e-6 * np.diag([1.0, 1.0, 0.0])
    places = [np.array([0.1 * index, 1.0, 0.0]) for index in range(4)]
    found = [
        {"ann": UserEstimate(name="ann", status="found", position=place, covariance=covariance)}
        for place in places
    ]
    found[2] = {}
    (ann,) = track_answers([0.0, 0.1, 0.2, 0.3], found)
    assert [answer.status for answer in ann.answers] == ["found", "found", "not_found", "found"]
    assert [point.candidate for point in ann.track.points] == [0, 0, None, 0]
    # Between fixes of 1 mm, 0.1 s away, at 1 m/s: white acceleration moves it by some mm.
    spread = np.sqrt(ann.track.points[2].covariance[0, 0])
    assert abs(ann.track.points[2].position - places[2])[0] < 4 * spread < 0.05


def test_what_is_no_series_of_measurements_is_refused(samples: xr.Dataset, tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match=r"no zarr\.json"):
        track(tmp_path)
    path = written(samples, tmp_path)
    with pytest.raises(MeasurementError, match="no variable 'time'"):
        track(path)
    with pytest.raises(MeasurementError, match="must be above 0"):
        track(path, step=0.0)
    written(samples.assign(time=("sample", np.array([0.0, 2.0, 1.0]))), tmp_path)
    with pytest.raises(MeasurementError, match="does not increase"):
        track(path)
    single = Measurement(
        echo=None, uplinks=(pilot(WAYS["ann"][0], "ann", np.random.default_rng(1)),)
    )
    write_measurement(tmp_path / "one.zarr", single)
    with pytest.raises(MeasurementError, match="needs several samples, this store has 1"):
        track(tmp_path / "one.zarr", step=1.0)
