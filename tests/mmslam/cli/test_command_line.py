import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from estimator.measurement.store import read_measurement
from mmslam.cli import app
from validation.metrics.truth import read_truth

CHECKOUT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Run in an empty folder, without a backend that the caller forced."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MMSLAM_BACKEND", raising=False)
    return tmp_path


def mmslam(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def refused(*arguments: str) -> str:
    """Run what must be refused: exit 2, a message, nothing on stdout, no traceback."""
    result = mmslam(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return " ".join(result.stderr.split())


def test_help_names_every_command() -> None:
    result = mmslam("--help")
    assert result.exit_code == 0
    for command in ("scenes", "run", "simulate", "locate", "import", "info"):
        assert command in result.stdout
        assert mmslam(command, "--help").exit_code == 0


def test_version_is_that_of_the_distribution() -> None:
    assert mmslam("--version").stdout == f"mmslam {version('mmslam')}\n"


def test_what_simulates_nothing_loads_neither_the_ray_tracer_nor_matplotlib() -> None:
    program = (
        "import sys\n"
        "from mmslam.cli import app\n"
        "heavy = {'drjit', 'mitsuba', 'sionna', 'simulator', 'matplotlib', 'plotly'}\n"
        "heavy |= {'dask', 'zarr'}\n"
        "for arguments in (['--help'], ['scenes'], ['scenes', 'slam_2d']):\n"
        "    try:\n"
        "        app(arguments)\n"
        "    except SystemExit as ended:\n"
        "        assert not ended.code, arguments\n"
        "    assert not heavy & set(sys.modules), (arguments, heavy & set(sys.modules))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=CHECKOUT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_an_estimate_loads_neither_scenarios_nor_packages_that_take_a_second_to_import() -> None:
    program = (
        "import sys\n"
        "from mmslam.cli import app\n"
        "import mmslam.location, estimator.localization.pipeline\n"
        "heavy = {'mitsuba', 'sionna', 'simulator', 'scenes', 'matplotlib', 'scipy.stats',\n"
        "    'scipy.optimize'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=CHECKOUT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_scenes_lists_names_and_titles() -> None:
    result = mmslam("scenes")
    assert result.exit_code == 0
    assert "slam_2d" in result.stdout
    listed = json.loads(mmslam("scenes", "--json").stdout)
    assert "slam_2d" in [scenario["name"] for scenario in listed]


def test_an_exported_scenario_is_read_back_as_the_same(away: Path) -> None:
    mmslam("scenes", "slam_2d", "--set", "objects.wall.angle_deg=35", "--export", "mine")
    again = json.loads(mmslam("scenes", "mine/slam_2d.toml", "--json").stdout)
    assert again["objects"]["wall"]["angle_deg"] == 35.0
    assert again == json.loads(
        mmslam("scenes", "slam_2d", "--set", "objects.wall.angle_deg=35", "--json").stdout
    )


def test_an_export_never_overwrites_what_somebody_changed(away: Path) -> None:
    assert mmslam("scenes", "slam_2d", "--export", "mine").exit_code == 0
    assert mmslam("scenes", "slam_2d", "--export", "mine").exit_code == 0  # the same once more
    (away / "mine" / "slam_2d.toml").write_text("# mine now")
    assert "exists with other content" in refused("scenes", "slam_2d", "--export", "mine")


def test_the_schema_is_one_of_json() -> None:
    schema = json.loads(mmslam("scenes", "--schema").stdout)
    assert "radio" in schema["properties"]


def test_show_draws_a_plan_and_prints_its_path(away: Path) -> None:
    assert mmslam("scenes", "slam_2d", "--show").stdout == "out/slam_2d.png\n"
    assert (away / "out" / "slam_2d.png").read_bytes().startswith(b"\x89PNG")
    mmslam("scenes", "slam_2d", "--show", "--out", "plan.png")
    assert (away / "plan.png").exists()


def test_scenes_says_which_options_belong_together() -> None:
    assert "need the NAME" in refused("scenes", "--show")
    assert "add --show" in refused("scenes", "slam_2d", "--out", "x.png")


def test_info_names_the_backend_and_the_versions() -> None:
    document = json.loads(mmslam("info", "--json").stdout)
    assert document["backend"] in ("llvm", "cuda")
    assert document["threads"] >= 1
    assert document["versions"]["numpy"] == np.__version__
    assert document["backend"] in mmslam("info").stdout


def test_an_unusable_backend_is_an_answer_of_info_and_an_error_elsewhere(away: Path) -> None:
    # A process of its own: an engine that has started keeps its backend.
    done = subprocess.run(
        [sys.executable, "-m", "mmslam", "info", "--json"],
        cwd=CHECKOUT,
        env={"MMSLAM_BACKEND": "abacus", "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    document = json.loads(done.stdout)
    assert document["backend"] is None
    assert "abacus" in document["backend_error"]
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", [["run"], ["simulate", "-o", "m.zarr"]])
def test_a_wrong_scenario_is_refused_with_key_and_value(command: list[str], away: Path) -> None:
    assert "did you mean 'slam_2d'" in refused(*command, "slam_2")
    message = refused(*command, "slam_2d", "--set", "objects.wall.lenth_m=0.4")
    assert "objects.wall.lenth_m" in message
    assert list(away.iterdir()) == []


def test_a_foreign_output_folder_is_refused_before_the_simulation(away: Path) -> None:
    (away / "thesis").mkdir()
    (away / "thesis" / "chapter1.tex").write_text("years of work")
    message = refused("run", "slam_2d", "--out", "thesis")
    assert "thesis" in message
    assert "no earlier run of mmslam" in message
    assert "not a measurement" in refused("simulate", "slam_2d", "-o", "thesis")
    assert [path.name for path in (away / "thesis").iterdir()] == ["chapter1.tex"]


def test_a_negative_seed_is_refused() -> None:
    assert "--seed" in refused("run", "slam_2d", "--seed=-1")


@pytest.mark.parametrize("prepare", ["nothing", "file", "empty", "truncated"])
def test_what_is_no_measurement_is_refused_by_locate(away: Path, prepare: str) -> None:
    store = away / "m.zarr"
    if prepare == "file":
        store.write_text("hello")
    elif prepare != "nothing":
        store.mkdir()
    if prepare == "truncated":
        (store / "zarr.json").write_text('{"zarr_format": 3, "node_')
    assert "m.zarr" in refused("locate", "m.zarr")
    assert not (away / "out").exists()


def reference(folder: Path) -> Path:
    rng = np.random.default_rng(2)
    samples = (rng.normal(size=(6, 4)) + 1j * rng.normal(size=(6, 4))).astype(np.complex64)
    along = np.linspace(-0.1, 0.1, 51)
    np.savez(
        folder / "full_wave.npz",
        echo=samples,
        uplink_beam=2 * samples,
        aperture_position=np.stack([np.arange(6) * 5e-4, np.zeros(6), np.zeros(6)], axis=-1),
        frequency=np.linspace(220e9, 223e9, 4),
        user_position=np.array([1.0, 0.8, 0.0]),
        wall_profile=np.stack([along, 0.8 + along, np.zeros(51)], axis=-1),
    )
    return folder / "full_wave.npz"


def test_an_imported_file_is_a_measurement_with_its_truth_apart(away: Path) -> None:
    result = mmslam("import", str(reference(away)), "-o", "m.zarr", "--json")
    assert json.loads(result.stdout)["users"] == ["user"]
    measurement = read_measurement(away / "m.zarr")
    assert measurement.waves == "cylindrical"
    assert measurement.echo is not None
    with np.load(away / "full_wave.npz") as source:
        np.testing.assert_array_equal(measurement.echo.samples, source["echo"])
    truth = read_truth(away / "m.zarr")
    np.testing.assert_allclose(truth.wall_end["wall"], [0.1, 0.9, 0.0], atol=1e-12)
    np.testing.assert_array_equal(truth.user_position["user"], [1.0, 0.8, 0.0])


def test_an_import_replaces_a_measurement_and_nothing_else(away: Path) -> None:
    source = str(reference(away))
    assert mmslam("import", source, "-o", "m.zarr").exit_code == 0
    assert mmslam("import", source, "-o", "m.zarr").exit_code == 0
    (away / "other").mkdir()
    (away / "other" / "zarr.json").write_text('{"zarr_format": 3, "node_type": "group"}')
    assert "not a measurement" in refused("import", source, "-o", "other")
    assert "no uplink 'horn'" in refused("import", source, "-o", "m.zarr", "--uplink", "horn")
    assert sorted(path.name for path in away.iterdir()) == ["full_wave.npz", "m.zarr", "other"]


@pytest.mark.parametrize("elements", ["1", "[1, 8]"])
def test_an_array_that_cannot_locate_is_refused_before_the_simulation(elements: str) -> None:
    setting = [] if elements == "1" else ["--set", "dimensions=3"]
    name = "slam_2d" if elements == "1" else "bench_3d"
    setting += ["--set", f"base_station.elements={elements}"]
    assert "with a linear array" in refused("run", name, *setting)


def test_antennas_that_stand_apart_cannot_locate_and_have_no_design() -> None:
    assert "its antennas stand apart" in refused("run", "rcs_drywall")
    assert "stand by themselves" in refused("design", "rcs_drywall")


@pytest.mark.parametrize("command", [("run",), ("simulate", "-o", "it.zarr"), ("scenes",)])
def test_an_override_without_set_is_refused_with_the_option_that_it_lacks(
    command: tuple[str, ...],
) -> None:
    told = refused(*command, "slam_2d", "objects.wall.angle_deg=40", "seed.x=1").replace("│ │ ", "")
    assert "extra arguments (objects.wall.angle_deg=40 seed.x=1)" in told
    assert "write --set objects.wall.angle_deg=40 --set seed.x=1" in told
    plain = refused(*command, "slam_2d", "again")
    assert "extra argument (again)" in plain
    assert "--set" not in plain


def test_a_room_is_written_as_a_page_to_turn(away: Path) -> None:
    pytest.importorskip("plotly")
    assert mmslam("scenes", "slam_2d", "--show", "--3d").stdout == "out/slam_2d.html\n"
    page = (away / "out" / "slam_2d.html").read_text(encoding="utf-8")
    assert '"layer":"paths to users"' in page
    told = mmslam("scenes", "slam_2d", "--show", "--3d", "--out", "room.html", "--json").stdout
    assert json.loads(told)["files"] == ["room.html"]
    assert "add --show" in refused("scenes", "slam_2d", "--3d")
    assert "call it room.html" in refused(
        "scenes", "slam_2d", "--show", "--3d", "--out", "room.png"
    )
