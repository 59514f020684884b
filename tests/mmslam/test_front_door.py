"""What ``import mmslam`` offers, on the thesis' scene at half its distances with a small array."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

import mmslam
from estimator import localization
from estimator.measurement import model
from estimator.results import estimate as plain
from validation.metrics.truth import Truth

SMALL = {
    "base_station.elements": 48,
    "radio.stop_ghz": 230.0,
    "radio.points": 101,
    "objects.wall.centre_m": (0.0, 0.4),
    "objects.wall.length_m": 0.2,
    "users.user.position_m": np.array([0.5, 0.4]),
}


@pytest.fixture(scope="module")
def measurement() -> mmslam.Measurement:
    return mmslam.simulate(mmslam.load_scenario("slam_2d", SMALL), seed=1)


@pytest.fixture(scope="module")
def estimate(measurement: mmslam.Measurement) -> mmslam.Estimate:
    return mmslam.locate(measurement)


@pytest.fixture(autouse=True)
def figures_closed() -> Iterator[None]:
    yield
    plt.close("all")


def test_the_user_behind_the_mirror_is_found_and_asked_for_by_name(
    measurement: mmslam.Measurement, estimate: mmslam.Estimate
) -> None:
    user = estimate.users["user"]
    assert user is estimate.users[0]
    assert user.position is not None
    assert user.covariance is not None
    assert user.uncertainty_m == pytest.approx(np.sqrt(np.trace(user.covariance)))
    error = np.linalg.norm(user.position - measurement.truth.user_position["user"])
    assert user.uncertainty_m is not None
    assert error < 4 * user.uncertainty_m  # beyond it, one normal draw in 16 000
    with pytest.raises(KeyError, match="no user 'bob'; there are user"):
        estimate.users["bob"]
    assert list(estimate.users.keys()) == ["user"]
    assert dict(estimate.users.items()) == dict(estimate.users) == {"user": user}
    assert "user" in estimate.users  # type: ignore[comparison-overlap]  # iterates over users
    assert "bob" not in estimate.users  # type: ignore[comparison-overlap]
    assert estimate.users.values() == (user,)
    assert user in estimate.users


def test_the_estimator_is_handed_the_measurement_proper_and_no_truth(
    measurement: mmslam.Measurement, estimate: mmslam.Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    handed: list[Any] = []

    def spy(seen: model.Measurement, **options: Any) -> plain.Estimate:
        handed.append(seen)
        return estimate

    monkeypatch.setattr(localization, "locate", spy)
    answer = mmslam.locate(measurement)
    (seen,) = handed
    assert type(seen) is model.Measurement
    assert set(vars(seen)) == set(model.Measurement.__dataclass_fields__)
    assert answer.measurement is seen


def test_a_false_truth_beside_a_measurement_changes_nothing(
    measurement: mmslam.Measurement, estimate: mmslam.Estimate
) -> None:
    told = measurement.truth_dataset
    assert told is not None
    false = told.copy(deep=True)
    false["user_position"] = told["user_position"] + 1.0
    misled = mmslam.locate(mmslam.Measurement.of(measurement.without_truth(), beside=false))
    np.testing.assert_array_equal(
        np.asarray(misled.users["user"].position), np.asarray(estimate.users["user"].position)
    )


def test_what_is_written_is_read_with_its_truth_and_answered_alike(
    measurement: mmslam.Measurement, estimate: mmslam.Estimate, tmp_path: Path
) -> None:
    mmslam.write(tmp_path / "room.zarr", measurement)
    read = mmslam.read(tmp_path / "room.zarr")
    assert "truth_dataset" not in vars(read)  # not opened yet
    again = mmslam.locate(read)
    assert "truth_dataset" not in vars(read)
    np.testing.assert_array_equal(
        np.asarray(again.users["user"].position), np.asarray(estimate.users["user"].position)
    )
    np.testing.assert_array_equal(
        read.truth.user_position["user"], measurement.truth.user_position["user"]
    )
    assert read.to_xarray().equals(measurement.to_xarray())


def test_the_document_of_an_estimate_is_that_of_the_command_line(
    measurement: mmslam.Measurement, estimate: mmslam.Estimate
) -> None:
    (user,) = estimate.to_dict(truth=measurement.truth)["users"]
    assert user["error_m"] < 4 * (estimate.users["user"].uncertainty_m or 0)
    (untold,) = estimate.to_dict()["users"]
    assert untold["error_m"] is None
    assert untold["estimate_m"] == user["estimate_m"]


def test_an_estimate_and_its_parts_print_a_few_short_lines(estimate: mmslam.Estimate) -> None:
    parts = [estimate, estimate.users, estimate.users["user"], *estimate.mirrors]
    parts += [estimate.raw_image, *estimate.maps]
    for part in parts:
        assert 1 < len(repr(part).splitlines()) < 12
        assert "array(" not in repr(part)
    assert "user  found   (0.5" in repr(estimate)


def test_a_notebook_shows_a_small_figure_above_the_tables(estimate: mmslam.Estimate) -> None:
    before = plt.get_fignums()
    assert estimate.raw_image is not None
    for part in (estimate, estimate.users["user"], estimate.raw_image, estimate.maps[0]):
        shown = part._repr_html_()
        assert shown.count("<img ") == 1
        assert shown.count("<table>") == shown.count("</table>") >= 1
        assert 5_000 < len(shown) < 200_000
    assert "<img" not in estimate.mirrors[0]._repr_html_()
    assert plt.get_fignums() == before  # pyplot is left alone: nothing is shown twice


def test_what_comes_from_a_file_cannot_write_markup_into_a_notebook() -> None:
    ann = mmslam.Estimate(
        users=_named("<script>"), mirrors=(), notes=("<b>bold</b>",)
    )._repr_html_()
    assert "<script>" not in ann
    assert "<b>" not in ann


def _named(name: str) -> Any:
    from mmslam.results.estimate import User, Users

    return Users([User(name=name, status="not_found", reason="no peak above the noise")])


def test_plots_take_axes_and_return_them(
    measurement: mmslam.Measurement, estimate: mmslam.Estimate
) -> None:
    truth = measurement.truth
    assert estimate.raw_image is not None
    image, user, heard = estimate.raw_image, estimate.users["user"], estimate.maps[0]
    drawn: list[Callable[[Axes | None], Axes]] = [
        lambda ax: mmslam.plot_estimate(estimate, truth=truth, ax=ax),
        lambda ax: mmslam.plot_user(user, truth=truth, ax=ax),
        lambda ax: mmslam.plot_image(image, ax=ax),
        lambda ax: mmslam.plot_angle_range_map(heard, ax=ax),
        lambda ax: mmslam.plot_scenario(mmslam.load_scenario("slam_2d"), ax=ax),
        lambda ax: estimate.plot(truth=truth, ax=ax),
    ]
    for draw in drawn:
        ax = plt.figure().add_subplot()
        assert draw(ax) is ax
        assert ax.has_data()
        made = draw(None)
        assert isinstance(made, Axes)
        assert made is not ax


def test_the_truth_is_drawn_where_it_is(
    measurement: mmslam.Measurement, estimate: mmslam.Estimate
) -> None:
    def rings(truth: Truth | None) -> list[np.ndarray]:
        lines = estimate.plot(truth=truth).lines
        return [
            np.asarray(line.get_xydata()) for line in lines if line.get_markerfacecolor() == "none"
        ]

    place = measurement.truth.user_position["user"][:2]
    assert any(len(ring) == 1 and np.allclose(ring[0], place) for ring in rings(measurement.truth))
    assert not any(len(ring) == 1 and np.allclose(ring[0], place) for ring in rings(None))


def test_an_estimate_without_an_aperture_is_not_drawn() -> None:
    nobody = plain.Estimate(users=(), mirrors=())
    with pytest.raises(ValueError, match=r"plot one that mmslam\.locate returned"):
        mmslam.plot_estimate(nobody)


def test_overrides_by_key_are_those_of_the_command_line() -> None:
    by_key = mmslam.load_scenario("slam_2d", {"objects.wall.angle_deg": 40, "noise.snr_db": 10})
    by_text = mmslam.load_scenario("slam_2d", ["objects.wall.angle_deg=40", "noise.snr_db=10"])
    assert by_key == by_text


def test_a_wrong_override_is_refused_by_its_key() -> None:
    with pytest.raises(ValueError, match=r"override 'radio\.points\.more'"):
        mmslam.load_scenario("slam_2d", {"radio.points.more": 3})
    with pytest.raises(ValueError, match=r"slam_2d: objects\.wall\.angle"):
        mmslam.load_scenario("slam_2d", {"objects.wall.angle": 40})


def test_a_dataset_is_made_of_tables_and_read_sample_by_sample(tmp_path: Path) -> None:
    config = {
        "base": "point_scatterers",
        "count": 3,
        "set": {"base_station.elements": 8, "radio.points": 8},
        "vary": {"noise.snr_db": {"kind": "grid", "values": [10, 20, 30]}},
    }
    told: list[tuple[int, int, int]] = []
    made = mmslam.make_dataset(
        config, tmp_path / "it.zarr", progress=lambda *step: told.append(step)
    )
    assert (made.samples, made.failed, made.made_now) == (3, 0, 3)
    assert told[-1] == (3, 0, 3)
    dataset = mmslam.open_dataset(tmp_path / "it.zarr")
    assert len(dataset) == len(list(dataset)) == 3
    assert dataset.made.all()
    np.testing.assert_array_equal(dataset[-1].truth.target_position["near"], [0.0, 0.5, 0.0])
    assert dataset.parameters is not None
    assert dataset.parameters["noise.snr_db"].values.tolist() == [10, 20, 30]
    assert "3, 0 of them failed" in repr(dataset)
    with pytest.raises(IndexError, match="sample 3 of 3"):
        dataset[3]


def test_what_is_no_dataset_is_refused(tmp_path: Path, measurement: mmslam.Measurement) -> None:
    with pytest.raises(model.MeasurementError, match=r"no zarr\.json"):
        mmslam.open_dataset(tmp_path)
    mmslam.write(tmp_path / "one.zarr", measurement)
    with pytest.raises(model.MeasurementError, match=r"read it with mmslam\.read"):
        mmslam.open_dataset(tmp_path / "one.zarr")


def test_some_samples_of_a_dataset_are_written_by_xarray(tmp_path: Path) -> None:
    small = {"base_station.elements": 4, "radio.points": 6}
    config = {"base": "point_scatterers", "count": 5, "set": small}
    mmslam.make_dataset(config, tmp_path / "all.zarr")
    every = mmslam.open_dataset(tmp_path / "all.zarr").to_xarray()
    some = every.isel(sample=slice(1, 4), frequency=[0, 2, 5])
    some.to_zarr(tmp_path / "some.zarr", consolidated=False)
    again = xr.open_zarr(tmp_path / "some.zarr", consolidated=False, chunks=None)
    np.testing.assert_array_equal(again["echo"], every["echo"][1:4, :, [0, 2, 5]])
    assert again["echo"].attrs == every["echo"].attrs


def test_a_sweep_of_tables_gives_an_array_and_a_plot(tmp_path: Path) -> None:
    config = {
        "base": "slam_2d",
        "realisations": 1,
        "set": {key: np.asarray(value).tolist() for key, value in SMALL.items()},
        "vary": {"noise.snr_db": {"kind": "grid", "values": [20, 30]}},
    }
    found = mmslam.sweep(config, cache=tmp_path)
    errors = found.to_xarray()["error"]
    assert errors.sizes == {"noise.snr_db": 2, "realisation": 1, "user": 1}
    # Five times the deviation of less than 1 mm that such an array states at 20 dB.
    assert float(errors.max()) < 5e-3
    assert len(repr(found).splitlines()) == 4
    assert found.plot().get_ylabel() == "distance from the truth [mm]"


def test_a_design_is_asked_by_name() -> None:
    design = mmslam.design("slam_2d", distance_m=1.8)
    # 0.886 λ_c R/(nD): 14.3 mm at 1.8 m over one way.
    assert design["cross-range cell, uplink"].value == pytest.approx(14.3, abs=0.05)
    assert "<table>" in design._repr_html_()
    with pytest.raises(KeyError, match="no 'colour'"):
        design["colour"]


def test_tracks_are_asked_by_name(measurement: mmslam.Measurement) -> None:
    with pytest.raises(model.MeasurementError, match="give the step"):
        mmslam.track([measurement, measurement])
    with pytest.raises(model.MeasurementError, match="needs several measurements"):
        mmslam.track([measurement], step=0.1)
    tracks = mmslam.track([measurement, measurement], step=0.1)
    points = tracks["user"].track.points
    assert [point.candidate for point in points] == [0, 0]
    assert np.linalg.norm(points[-1].velocity) < 0.1  # it stands still
    assert len(repr(tracks).splitlines()) == 3
    assert tracks.plot().has_data()
    with pytest.raises(KeyError, match="no user 'bob'"):
        tracks["bob"]
