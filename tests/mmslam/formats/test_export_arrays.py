import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import zarr
from scipy.io import loadmat
from typer.testing import CliRunner, Result

from mmslam.cli import app
from mmslam.formats import export_arrays
from simulator.dataset.builder import make_dataset, plan_dataset
from simulator.dataset.task_runner import Workers

CONFIG = """
base = "point_scatterers"
count = 5
set.base_station.elements = 4
set.radio.points = 6
set."users.ann.position_m" = [0.2, 0.5]
[vary]
"noise.snr_db" = { kind = "uniform", low = 10.0, high = 30.0 }
"points.near.position_m" = { kind = "in_box", low_m = [-0.1, 0.4], high_m = [0.1, 0.5] }
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    (folder / "config.toml").write_text(CONFIG, encoding="utf-8")
    make_dataset(
        plan_dataset(folder / "config.toml", folder / "it.zarr"), workers=Workers(processes=0)
    )
    return folder / "it.zarr"


def mmslam(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(one) for one in arguments])


def stored(store: Path, name: str) -> np.ndarray:
    array = zarr.open_group(store, mode="r")[name]
    assert isinstance(array, zarr.Array)
    return np.asarray(array[...])


def test_netcdf_holds_all_samples_with_complex_numbers(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export_arrays, "SAMPLES_AT_ONCE", 2)
    result = mmslam("export", store, "--netcdf", tmp_path / "it.nc")
    assert result.exit_code == 0, result.output
    with netCDF4.Dataset(tmp_path / "it.nc", auto_complex=True) as read:
        np.testing.assert_array_equal(read["echo"][...], stored(store, "echo"))
        assert read["echo"].dimensions == ("sample", "position", "frequency")
        truth = read.groups["truth"]
        np.testing.assert_array_equal(
            truth["user_position"][...].filled(np.nan), stored(store, "truth/user_position")
        )
        assert truth["user_position"].units == "m"
        assert truth["target_kind"][0].tolist() == ["point"] * 3
        drawn = read.groups["parameters"]["noise.snr_db"]
        np.testing.assert_array_equal(drawn[...], stored(store, "parameters/noise.snr_db"))
        assert "exp(-j 2 pi f tau)" in read.conventions


def test_matlab_holds_chosen_samples_as_structures(store: Path, tmp_path: Path) -> None:
    result = mmslam("export", store, "--matlab", tmp_path / "it.mat", "--sample", 3, "--sample", 1)
    assert result.exit_code == 0, result.output
    read = loadmat(tmp_path / "it.mat", simplify_cells=True)
    np.testing.assert_array_equal(read["uplink"], stored(store, "uplink")[[3, 1]][:, 0])  # squeezed
    np.testing.assert_array_equal(
        read["parameters"]["noise_snr_db"], stored(store, "parameters/noise.snr_db")[[3, 1]]
    )
    assert read["truth"]["user_position"].shape == (2, 3)
    assert read["attributes"]["variables"]["frequency"]["units"] == "Hz"
    assert read["attributes"]["seed"] == 0


def test_wrong_exports_are_refused(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*arguments: object) -> str:
        result = mmslam("export", *arguments)
        assert result.exit_code == 2, result.output
        return " ".join(result.stderr.split())

    told = refused(store)
    assert "give one of --touchstone, --netcdf, --matlab" in told
    assert "--huggingface" in told
    new = tmp_path / "it.mat"
    assert "sample 5 of 5; it must be 0…4" in refused(store, "--matlab", new, "--sample", 5)
    assert "not a Zarr v3 group" in refused(tmp_path, "--matlab", new)
    told = refused(store, "--touchstone", tmp_path / "t", "--sample", 0, "--sample", 1)
    assert "one --sample at a time" in told
    with monkeypatch.context() as patch:
        patch.setattr(export_arrays, "LARGEST_IN_MATLAB", 100)
        assert "choose some samples" in refused(store, "--matlab", new)
    new.write_text("mine")
    assert "it.mat exists; move it away" in refused(store, "--matlab", new)
    assert new.read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["it.mat"]


@pytest.mark.parametrize("what", ["--matlab", "--netcdf", "--touchstone", "--huggingface"])
@pytest.mark.parametrize("whole", [False, True])
def test_no_export_follows_a_link_out_of_the_store(
    store: Path, tmp_path: Path, what: str, whole: bool
) -> None:
    inside = tmp_path / "a.zarr"
    shutil.copytree(store, inside)
    linked = inside / "echo" / "c"
    if not whole:  # a single file of the samples
        linked = next(path for path in sorted(linked.rglob("*")) if path.is_file())
    outside = linked.rename(tmp_path / "outside")
    linked.symlink_to(outside)
    one = ("--sample", 0) if what == "--touchstone" else ()
    result = mmslam("export", inside, what, tmp_path / "new", *one)
    assert result.exit_code == 2, result.output
    assert "is a link out of the store" in " ".join(result.stderr.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.zarr", "outside"]


def test_a_script_beside_says_what_each_variable_of_the_matlab_file_is(
    store: Path, tmp_path: Path
) -> None:
    file = tmp_path / "some rooms.mat"
    assert mmslam("export", store, "--matlab", file).exit_code == 0
    told = (tmp_path / "read_me_some_rooms.m").read_text(encoding="utf-8")
    described = [line.split()[1] for line in told.splitlines() if line.startswith("%   ")]
    content = loadmat(file, simplify_cells=True)
    for place in described:
        here = content
        for name in place.split("."):
            here = here[name]
    assert {"echo", "uplink", "frequency", "truth.user_position"} <= set(described)
    assert "load('some rooms.mat')" in told
    assert "m.echo(1, 1, :)" in told  # sample, position, frequency
