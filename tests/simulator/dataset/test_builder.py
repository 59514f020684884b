import filecmp
import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.constants import speed_of_light

from estimator.measurement.model import MeasurementError
from estimator.measurement.store import read_measurement
from scenes.sampling.sample_space import SampleSpace
from scenes.scenario import ScenarioError
from simulator.dataset import builder, layout, store
from simulator.dataset.builder import DatasetJob, forecast, make_dataset, plan_dataset
from simulator.dataset.layout import Layout
from simulator.dataset.sample import Row, make_row
from simulator.dataset.store import DatasetError
from simulator.dataset.task_runner import Workers
from simulator.simulation import simulate
from validation.metrics.truth import read_truth

HERE = Workers(processes=0)

POINTS = """
base = "point_scatterers"
count = 10
seed = 5
set.base_station.elements = 16
set.radio.points = 16
set."users.ann.position_m" = [0.2, 0.5]
[vary]
"points.near.position_m" = { kind = "in_box", low_m = [-0.1, 0.4], high_m = [0.1, 0.5] }
"noise.snr_db" = { kind = "uniform", low = 10.0, high = 30.0 }
"""


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten samples shall be three files, the last one not full."""
    monkeypatch.setattr(layout, "BLOCK_SAMPLES", 4)


def planned(folder: Path, text: str = POINTS, name: str = "it.zarr") -> DatasetJob:
    (folder / "config.toml").write_text(text, encoding="utf-8")
    return plan_dataset(folder / "config.toml", folder / name)


def opened(job: DatasetJob, group: str | None = None) -> xr.Dataset:
    found: xr.Dataset = xr.open_zarr(job.target, group=group, consolidated=False, chunks=None)
    return found.load()


def same_bytes(one: Path, other: Path) -> bool:
    files = [
        sorted(p.relative_to(top) for p in top.rglob("*") if p.is_file()) for top in (one, other)
    ]
    if files[0] != files[1]:
        return False
    return filecmp.cmpfiles(one, other, files[0], shallow=False)[1:] == ([], [])


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> DatasetJob:
    """Return a dataset that was made in one go."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layout, "BLOCK_SAMPLES", 4)
        job = planned(tmp_path_factory.mktemp("quiet"))
        told: list[tuple[int, int, int]] = []
        summary = make_dataset(job, workers=HERE, tell=lambda *now: told.append(now))
    assert (summary.samples, summary.failed, summary.made_now) == (10, 0, 10)
    assert told == [(n, 0, 10) for n in range(11)]
    return job


def test_a_sample_is_what_its_scenario_alone_gives(quiet: DatasetJob) -> None:
    for sample in (0, 9):
        attempt, _ = quiet.space.first(sample)
        assert attempt.scenario is not None
        alone = simulate(attempt.scenario, seed=5, sample=sample)
        read = read_measurement(quiet.target, sample=sample)
        assert read.echo is not None
        assert alone.measurement.echo is not None
        # Single precision: half a unit in the last of 24 bits, relative to each part.
        np.testing.assert_allclose(read.echo.samples, alone.measurement.echo.samples, rtol=1e-7)
        (mine,), (theirs,) = read.uplinks, alone.measurement.uplinks
        np.testing.assert_allclose(mine.samples, theirs.samples, rtol=1e-7)
        np.testing.assert_array_equal(mine.positions, theirs.positions)
        np.testing.assert_array_equal(mine.frequencies, theirs.frequencies)
        assert (read.seed, read.scenario, mine.user) == (5, "point_scatterers", "ann")
        truth = read_truth(quiet.target, sample=sample)
        place = attempt.values["points.near.position_m"]
        assert truth.target_position["near"].tolist() == place
        assert truth.target_kind["near"] == "point"


def test_a_dataset_describes_itself(quiet: DatasetJob) -> None:
    root = opened(quiet)
    assert root["echo"].dims == ("sample", "position", "frequency")
    assert root["uplink"].dims == ("sample", "user", "element", "frequency")
    assert root["aperture_position"].dims == ("position", "axis")  # once for all samples
    assert root["frequency"].attrs["units"] == "Hz"
    assert "exp(-j 2 pi f tau)" in root.attrs["conventions"]
    assert root.attrs["seed"] == 5
    assert '"count": 10' in root.attrs["config"]
    assert "mmslam" in root.attrs["versions"]
    drawn = opened(quiet, "parameters")
    assert drawn["noise.snr_db"].attrs["units"] == "dB"
    assert drawn["points.near.position_m"].dims == ("sample", "axis")
    snr = [quiet.space.first(n)[0].values["noise.snr_db"] for n in range(10)]
    assert drawn["noise.snr_db"].values.tolist() == snr
    assert not [path for path in quiet.target.parent.iterdir() if "unfinished" in path.name]


def test_what_the_estimator_reads_holds_no_drawn_parameter(quiet: DatasetJob) -> None:
    assert not any("snr" in str(name) or "near" in str(name) for name in opened(quiet).variables)


def test_the_direct_path_has_the_angle_and_delay_of_the_straight_line(quiet: DatasetJob) -> None:
    truth = opened(quiet, "truth")
    assert truth["path_count"].values.tolist() == [[1]] * 10
    assert truth["line_of_sight"].values.tolist() == [[1]] * 10
    angle, delay = truth["path_angle"].values[0, 0], truth["path_delay"].values[0, 0]
    assert angle[0] == pytest.approx(math.atan2(0.5, 0.2), abs=1e-12)
    assert delay[0] * speed_of_light == pytest.approx(math.hypot(0.2, 0.5), abs=1e-12)
    assert np.all(np.isnan(angle[1:]))
    assert truth["path_bounces"].values[0, 0].tolist() == [0] + [-1] * 7


def test_a_path_over_a_wall_has_the_angle_and_length_of_the_image_source(tmp_path: Path) -> None:
    job = planned(
        tmp_path,
        """
        base = "los_user"
        count = 1
        set.base_station.elements = 8
        set.radio.points = 8
        set."objects.wall.roughness" = { rms_mm = 0.0, correlation_mm = 0.3 }
        set."users.user.position_m" = [0.5, 0.75]
        """,
    )
    make_dataset(job, workers=HERE)
    truth = opened(job, "truth")
    assert truth["path_bounces"].values[0, 0, :3].tolist() == [0, 1, -1]
    # The wall is the line y = 0.8 + x: it images (x, y) to (y − 0.8, x + 0.8).
    image = (0.75 - 0.8, 0.5 + 0.8)
    assert truth["path_angle"].values[0, 0, 1] == pytest.approx(math.atan2(image[1], image[0]))
    assert truth["path_delay"].values[0, 0, 1] * speed_of_light == pytest.approx(math.hypot(*image))
    assert truth["line_of_sight"].values.tolist() == [[1]]
    assert truth["wall"].values.tolist() == ["wall"]


def test_an_interrupted_run_goes_on_to_the_same_bytes(quiet: DatasetJob, tmp_path: Path) -> None:
    job = planned(tmp_path)

    def stop_at(sample: int) -> builder.Tally:
        def tell(done: int, failed: int, total: int) -> None:
            if done == sample:
                raise KeyboardInterrupt

        return tell

    for sample in (3, 6):
        with pytest.raises(KeyboardInterrupt):
            make_dataset(job, workers=HERE, tell=stop_at(sample))
        assert not job.target.exists()
    assert builder.progress_of(job) == (6, 10)
    # What a process leaves that is killed in the middle of writing, or a machine that loses power:
    samples = tmp_path / "it.zarr.unfinished" / "samples"
    (samples / "8.npz.4711.part").write_bytes(b"half")
    (samples / "9.npz").write_bytes(b"PK torn")
    (samples / "0.npz").write_bytes((samples / "4.npz").read_bytes())  # of a block that is stored
    summary = make_dataset(job, workers=HERE)
    assert summary.made_now == 4
    assert same_bytes(quiet.target, job.target)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["config.toml", "it.zarr"]


@pytest.mark.parametrize("left", [0, 2, 4])
def test_a_block_may_be_collected_again_by_another_worker(
    quiet: DatasetJob, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, left: int
) -> None:
    """One that was killed may have kept the block, and removed some of its samples."""
    job = planned(tmp_path)
    once = store.GrowingDataset.collect

    def twice(growing: store.GrowingDataset, block: int) -> None:
        samples = list(growing.layout.block_samples(block))[:left]
        rows = [growing._staged_row(sample) for sample in samples]
        once(growing, block)
        for sample, row in zip(samples, rows, strict=True):
            growing.put(sample, row)
        once(growing, block)

    monkeypatch.setattr(store.GrowingDataset, "collect", twice)
    make_dataset(job, workers=HERE)
    assert same_bytes(job.target, quiet.target)


def test_a_finished_dataset_is_left_as_it_is(quiet: DatasetJob) -> None:
    before = quiet.target.stat().st_mtime_ns
    assert make_dataset(quiet, workers=HERE).made_now == 0
    assert make_dataset(quiet, workers=HERE, retry_failed=True).made_now == 0
    assert quiet.target.stat().st_mtime_ns == before


def test_another_configuration_or_version_is_refused_not_mixed(
    quiet: DatasetJob, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = planned(tmp_path, POINTS.replace("seed = 5", "seed = 6"))
    moved = DatasetJob(
        source=other.source, config=other.config, target=quiet.target, identity=other.identity
    )
    with pytest.raises(DatasetError, match=r"was made with another config \(seed\)"):
        make_dataset(moved, workers=HERE)
    begun = planned(tmp_path)
    with pytest.raises(ZeroDivisionError):
        make_dataset(begun, workers=HERE, tell=lambda done, *_: print(1 // (2 - done)))
    changed = planned(tmp_path, POINTS.replace("high = 30.0", "high = 31.0"))
    with pytest.raises(DatasetError, match=r"begun with another config \(vary\)"):
        make_dataset(changed, workers=HERE)
    monkeypatch.setattr(store, "IDENTITY", ("config", "base", "versions", "code"))
    monkeypatch.setattr("simulator.dataset.config.code_digest", lambda: "older")
    with pytest.raises(DatasetError, match="begun with another code of mmslam"):
        make_dataset(begun, workers=HERE)


def test_what_is_no_dataset_is_not_touched(tmp_path: Path) -> None:
    job = planned(tmp_path)
    job.target.mkdir()
    (job.target / "mine.txt").write_text("mine")
    with pytest.raises(DatasetError, match="exists and is not a dataset"):
        make_dataset(job, workers=HERE)
    (job.target / "mine.txt").unlink()
    job.target.rmdir()
    (tmp_path / "it.zarr.unfinished").mkdir()
    (tmp_path / "it.zarr.unfinished" / "mine.txt").write_text("mine")
    with pytest.raises(DatasetError, match="what mmslam did not write"):
        make_dataset(job, workers=HERE)


def test_two_processes_do_not_make_one_dataset(tmp_path: Path) -> None:
    job = planned(tmp_path)
    with (
        store.GrowingDataset(job.target, builder._layout(job)).locked(),
        pytest.raises(DatasetError, match="is being made by another process"),
    ):
        make_dataset(job, workers=HERE)


def test_failed_samples_are_listed_and_made_again_alone(
    quiet: DatasetJob, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = planned(tmp_path)

    def failing(space: SampleSpace, layout: Layout, sample: int) -> Row:
        with monkeypatch.context() as patch:
            if sample in (2, 9):
                patch.setattr("simulator.dataset.sample._put_truth", lambda *_: 1 // 0)
            return make_row(space, layout, sample)

    monkeypatch.setattr(builder, "make_row", failing)
    summary = make_dataset(job, workers=HERE)
    assert (summary.failed, [one.sample for one in summary.failures]) == (2, [2, 9])
    assert "ZeroDivisionError" in summary.failures[0].reason
    snr = job.space.first(2)[0].values["noise.snr_db"]
    assert summary.failures[0].parameters["noise.snr_db"] == snr
    assert opened(job)["status"].values.tolist() == [0, 0, 1, 0, 0, 0, 0, 0, 0, 1]
    with pytest.raises(MeasurementError, match=r"sample 2 could not be made.*--retry-failed"):
        read_measurement(job.target, sample=2)
    assert read_measurement(job.target, sample=3).echo is not None
    # Interrupted while it makes them again, and then with what is unfinished:
    monkeypatch.setattr(builder, "make_row", lambda *_: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        make_dataset(job, workers=HERE, retry_failed=True)
    monkeypatch.setattr(builder, "make_row", make_row)
    again = make_dataset(job, workers=HERE, retry_failed=True)
    assert (again.failed, again.made_now) == (0, 2)
    assert same_bytes(quiet.target, job.target)


def test_an_unfinished_dataset_forgets_its_failed_samples(
    quiet: DatasetJob, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = planned(tmp_path)

    def failing(space: SampleSpace, layout: Layout, sample: int) -> Row:
        if sample == 8:
            raise OSError(28, "No space left on device")
        with monkeypatch.context() as patch:
            if sample in (1, 6):
                patch.setattr("simulator.dataset.sample._put_truth", lambda *_: 1 // 0)
            return make_row(space, layout, sample)

    monkeypatch.setattr(builder, "make_row", failing)
    with pytest.raises(DatasetError, match=r"No space left on device.*the same command goes on"):
        make_dataset(job, workers=HERE)
    monkeypatch.setattr(builder, "make_row", make_row)
    assert make_dataset(job, workers=HERE, retry_failed=True).made_now == 4  # 1, 6, 8 and 9
    assert same_bytes(quiet.target, job.target)


def test_samples_of_different_length_are_padded_and_read_without_padding(tmp_path: Path) -> None:
    job = planned(
        tmp_path,
        """
        base = "point_scatterers"
        seed = 1
        set."users.ann.position_m" = [0.2, 0.5]
        set."users.bob.position_m" = [-0.3, 0.4]
        set.base_station.elements = 4
        precision = "double"
        [vary]
        "base_station.elements" = { kind = "grid", values = [4, 9] }
        "radio.points" = { kind = "grid", values = [8, 5] }
        "impairments.clock_offset_ns" = { kind = "uniform", low = -1.0, high = 1.0 }
        [number.users]
        among = ["users.ann", "users.bob"]
        """,
    )
    make_dataset(job, workers=HERE)
    users = set()
    for sample, shape in enumerate([(4, 8), (4, 5), (9, 8), (9, 5)]):
        attempt, _ = job.space.first(sample)
        assert attempt.scenario is not None
        alone = simulate(attempt.scenario, seed=1, sample=sample).measurement
        read = read_measurement(job.target, sample=sample)
        assert read.echo is not None
        assert alone.echo is not None
        assert read.echo.samples.shape == shape
        np.testing.assert_array_equal(read.echo.samples, alone.echo.samples)
        np.testing.assert_array_equal(read.echo.frequencies, alone.echo.frequencies)
        np.testing.assert_array_equal(read.echo.positions, alone.echo.positions)
        assert [one.user for one in read.uplinks] == [one.user for one in alone.uplinks]
        for mine, theirs in zip(read.uplinks, alone.uplinks, strict=True):
            np.testing.assert_array_equal(mine.samples, theirs.samples)
        assert read.clock_offset == alone.clock_offset
        users.add(len(read.uplinks))
    assert len(users) > 1
    root = opened(job)
    assert root["echo"].shape == (4, 9, 8)
    assert root["frequency"].dims == ("sample", "frequency")
    assert (
        opened(job, "truth")["user_count"].values.tolist() == root["uplink_count"].values.tolist()
    )


def test_a_chunk_that_is_missing_is_noticed(quiet: DatasetJob, tmp_path: Path) -> None:
    job = planned(tmp_path)
    make_dataset(job, workers=HERE)
    (job.target / "uplink" / "c" / "0" / "0" / "0" / "0").unlink()
    with pytest.raises(MeasurementError, match="NaN"):
        read_measurement(job.target, sample=1)
    (job.target / "uplink_present" / "c" / "0" / "0").unlink()
    with pytest.raises(MeasurementError, match="uplink_count = 1 of sample 5, but 0 users"):
        read_measurement(job.target, sample=5)


def test_the_waves_cannot_vary_within_one_dataset(tmp_path: Path) -> None:
    job = planned(
        tmp_path,
        'base = "los_user"\n[vary]\nwaves = { kind = "grid", values = ["spherical", '
        '"cylindrical"] }\n',
    )
    with pytest.raises(ScenarioError, match=r"vary\.waves: must be the same"):
        make_dataset(job, workers=HERE)


def test_a_forecast_counts_and_weighs_without_writing(quiet: DatasetJob, tmp_path: Path) -> None:
    job = planned(tmp_path)
    found = forecast(job)
    assert found.samples == 10
    assert found.raw_bytes == 2 * 16 * 16 * 8  # echo and one uplink, complex64
    assert 0 < found.sample_seconds < 30
    assert [path.name for path in tmp_path.iterdir()] == ["config.toml"]
    # Noise hardly packs: its exponents and signs are 9 of 32 bits, the rest is random.
    assert 0.7 * found.raw_bytes < found.sample_bytes < 2 * found.raw_bytes
