import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import xarray as xr
from typer.testing import CliRunner, Result

from mmslam.cli import app

CHECKOUT = Path(__file__).resolve().parents[3]

CONFIG = """
base = "point_scatterers"
count = 6
seed = 5
set.base_station.elements = 16
set.radio.points = 16
[vary]
"points.near.position_m" = { kind = "in_box", low_m = [-0.1, 0.4], high_m = [0.1, 0.5] }
"""


@pytest.fixture(autouse=True)
def away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.toml").write_text(CONFIG, encoding="utf-8")
    return tmp_path


def mmslam(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def test_a_dataset_is_made_described_and_located(away: Path) -> None:
    ahead = mmslam("dataset", "config.toml", "-o", "it.zarr", "--dry-run", "--json")
    assert ahead.exit_code == 0, ahead.output
    forecast = json.loads(ahead.stdout)
    assert forecast["samples"] == 6
    assert forecast["raw_bytes"] == 16 * 16 * 8
    assert forecast["size_bytes"] == 6 * forecast["sample_bytes"]
    assert [path.name for path in away.iterdir()] == ["config.toml"]
    told = mmslam("dataset", "config.toml", "-o", "it.zarr", "--dry-run")
    assert told.stdout.startswith("6 samples, ")

    made = mmslam("dataset", "config.toml", "-o", "it.zarr", "--workers", "0", "--json")
    assert made.exit_code == 0, made.output
    document = json.loads(made.stdout)
    assert document["samples"] == document["made_now"] == 6
    assert document["failures"] == []
    assert "6 of 6 done, 0 failed" in made.stderr
    # Three lines suffice to read it.
    found = xr.open_zarr("it.zarr", consolidated=False, chunks=None)
    assert found["echo"].sizes == {"sample": 6, "position": 16, "frequency": 16}
    located = mmslam("locate", "it.zarr", "--sample", "5", "--out", "located", "--json")
    assert located.exit_code == 0, located.output
    assert json.loads(located.stdout)["seed"] == 5
    again = mmslam("dataset", "config.toml", "-o", "it.zarr", "--workers", "0")
    assert again.stdout == "it.zarr: 6 samples, 0 failed\n"


def test_samples_that_fail_are_listed_with_their_parameters_and_exit_code_1(away: Path) -> None:
    # A point may come no closer to the array than the longest wavelength, 1.4 mm: half of them do.
    text = CONFIG.replace("[-0.1, 0.4]", "[0.0, 0.0]").replace("[0.1, 0.5]", "[0.0, 0.003]")
    text = text.replace("count = 6", "count = 6\nattempts = 1")
    (away / "config.toml").write_text(text.replace("seed = 5", "seed = 1"), encoding="utf-8")
    made = mmslam("dataset", "config.toml", "-o", "it.zarr", "--workers", "0")
    assert made.exit_code == 1, made.output
    assert "failed: sample" in made.stdout
    assert "none of 1 draws is possible" in made.stdout
    assert "points.near.position_m = [0.0, 0.00" in made.stdout
    assert "`--retry-failed` makes them again" in made.stdout


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["config.toml"], "needs CONFIG and --output"),
        (["none.toml", "-o", "it.zarr"], "none.toml: cannot be read"),
        (["config.toml", "-o", "config.toml"], "is not a dataset"),
        (["config.toml", "-o", "it.zarr", "--workers", "2", "--scheduler", "tcp://a:1"], "leave"),
    ],
)
def test_wrong_commands_are_refused(arguments: list[str], told: str) -> None:
    result = mmslam("dataset", *arguments)
    assert result.exit_code == 2, result.output
    assert told in " ".join(result.stderr.split())


def test_the_schema_of_configurations_is_one_of_json() -> None:
    schema = json.loads(mmslam("dataset", "--schema").stdout)
    assert {"base", "vary", "number", "precision"} <= set(schema["properties"])


def test_ctrl_c_leaves_a_dataset_that_the_same_command_finishes(away: Path) -> None:
    text = CONFIG.replace("count = 6", "count = 400")
    (away / "config.toml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "mmslam", "dataset", str(away / "config.toml")]
    command += ["-o", str(away / "it.zarr"), "--workers", "0"]
    run = subprocess.Popen(
        command,
        cwd=CHECKOUT,
        stderr=subprocess.PIPE,
        text=True,
        # A test in the background is deaf to Ctrl-C, and so would be what it starts.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    samples = away / "it.zarr.unfinished" / "samples"
    began = time.monotonic()
    while time.monotonic() - began < 120 and not any(samples.glob("*.npz")):
        time.sleep(0.05)
    run.send_signal(signal.SIGINT)
    _, told = run.communicate(timeout=60)
    assert run.returncode == 130, told
    assert "of 400 samples are done: the same command goes on" in told
    assert "Traceback" not in told
    assert not (away / "it.zarr").exists()
