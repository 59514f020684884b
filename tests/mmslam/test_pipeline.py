"""One small scenario all the way: the thesis' scene at half its distances, a third of its array."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from mmslam import own_results
from mmslam.cli import app
from mmslam.pipeline import run_scenario
from scenes.files.loading import load_scenario
from scenes.schema.errors import ScenarioError

CHECKOUT = Path(__file__).resolve().parents[2]
SMALL = [
    "slam_2d",
    "--set=base_station.elements=101",
    "--set=radio.points=351",
    "--set=objects.wall.centre_m=[0.0, 0.4]",
    "--set=objects.wall.length_m=0.2",
    "--set=users.user.position_m=[0.5, 0.4]",
]


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "mmslam", *arguments]


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(CHECKOUT)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


@pytest.fixture(scope="module")
def printed(folder: Path) -> str:
    """What `mmslam run --json` prints on stdout; in `folder`, its results lie in `out`."""
    done = subprocess.run(
        command("run", *SMALL, "--json", "--out", "out"),
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def result(printed: str) -> dict[str, Any]:
    document = json.loads(printed)  # fails if anything but one document was printed
    assert isinstance(document, dict)
    return document


def without_timings(document: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in document.items() if key != "timings_s"}


def test_stdout_is_the_result_file(printed: str, folder: Path) -> None:
    assert printed == (folder / "out" / own_results.RESULT).read_text(encoding="utf-8")


def test_the_folder_holds_what_was_promised_and_nothing_lies_beside_it(
    result: dict[str, Any], folder: Path
) -> None:
    assert {path.name for path in (folder / "out").iterdir()} == {
        *own_results.FIGURES,
        own_results.RESULT,
        own_results.REPORT,
        own_results.MEASUREMENT,
    }
    assert [path.name for path in folder.iterdir() if path.name.startswith(".")] == []


def test_the_user_behind_the_mirror_is_found_within_its_stated_error(
    result: dict[str, Any],
) -> None:
    (user,) = result["users"]
    assert (user["status"], user["bounces"]) == ("found", 1)
    spread = np.sqrt(np.trace(np.array(user["covariance_m2"])))
    assert user["error_m"] < 4 * spread  # beyond it, one normal draw in 16 000
    assert spread < 2e-3  # c/2B: a stated error of more than a range cell would say nothing
    assert user["error_m"] == pytest.approx(
        np.linalg.norm(np.subtract(user["estimate_m"], user["truth_m"]))
    )


def test_the_mirror_is_found_within_its_stated_error(result: dict[str, Any]) -> None:
    (mirror,) = result["mirrors"]
    (error,) = result["comparison"]["mirrors"]
    angle, offset = np.sqrt(np.diag(np.array(mirror["covariance"])))
    assert error["truth_name"] == "wall"
    assert np.radians(error["angle_error_deg"]) < 4 * angle
    assert abs(error["offset_error_m"]) < 4 * offset
    assert error["covered"] > 0.9  # both ends within a twentieth of the wall


def test_simulating_again_gives_the_same_bytes(result: dict[str, Any], folder: Path) -> None:
    again = CliRunner().invoke(app, ["simulate", *SMALL, "-o", str(folder / "again.zarr")])
    assert again.exit_code == 0, again.output
    first = xr.load_dataset(
        folder / "out" / own_results.MEASUREMENT, engine="zarr", consolidated=False
    )
    second = xr.load_dataset(folder / "again.zarr", engine="zarr", consolidated=False)
    assert first.echo.values.tobytes() == second.echo.values.tobytes()
    assert first.uplink.values.tobytes() == second.uplink.values.tobytes()
    assert first.attrs == second.attrs


def test_locating_from_the_file_answers_as_the_run_did(
    result: dict[str, Any], folder: Path
) -> None:
    store = str(folder / "out" / own_results.MEASUREMENT)
    located = CliRunner().invoke(app, ["locate", store, "--json", "--out", str(folder / "located")])
    assert located.exit_code == 0, located.output
    assert without_timings(json.loads(located.stdout)) == without_timings(result)
    assert not (folder / "located" / own_results.MEASUREMENT).exists()


def test_results_never_replace_the_measurement_they_come_from(
    result: dict[str, Any], folder: Path
) -> None:
    store = folder / "out" / own_results.MEASUREMENT
    refused = CliRunner().invoke(app, ["locate", str(store), "--out", str(folder / "out")])
    assert refused.exit_code == 2
    assert "holds the measurement" in refused.stderr
    assert store.exists()


def test_ctrl_c_in_the_middle_of_a_run_leaves_nothing_behind(tmp_path: Path) -> None:
    child = subprocess.Popen(
        command("run", *SMALL, "--out", "a/out"),
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("a/.out.mmslam")):  # the folder that it writes aside
        assert child.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    printed, errors = child.communicate(timeout=60)
    assert child.returncode == 130
    assert printed == ""
    assert errors == "mmslam: interrupted; nothing was written\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("elements", "told"), [("1", "1"), ("[1, 4]", r"\[1, 4\]")])
def test_an_array_too_small_to_locate_is_refused_before_work_as_it_was_given(
    tmp_path: Path, elements: str, told: str
) -> None:
    scenario = load_scenario("bench_3d", [f"base_station.elements={elements}"])
    with pytest.raises(ScenarioError, match=rf"base_station\.elements = {told}: .*give more"):
        run_scenario(scenario, seed=0, folder=tmp_path / "out")
    assert not any(tmp_path.iterdir())
