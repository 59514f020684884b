import re
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from typer.testing import CliRunner

import mmslam
from estimator.measurement.store import read_measurement
from mmslam.cli import app

CHECKOUT = Path(__file__).resolve().parents[2]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def test_the_two_commands_stand_as_promised() -> None:
    assert "\npip install uv && uv run mmslam run slam_2d\n" in README
    assert "\npip install uv && uv run pytest\n" in README


HALF_SIZE = {
    "base_station.elements": 160,
    "radio.points": 501,
    "objects.wall.centre_m": [0.0, 0.4],
    "objects.wall.length_m": 0.2,
    "users.user.position_m": [0.5, 0.4],
}


def test_the_five_lines_run_as_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    """They load a room of half the size; that of the library is claimed by fig04_09_slam_2d."""
    load = mmslam.load_scenario
    monkeypatch.setattr(
        mmslam, "load_scenario", lambda name, changes: load(name, HALF_SIZE | changes)
    )
    assert sum(bool(line) for line in PYTHON[0].splitlines()) == 5
    names: dict[str, Any] = {}
    exec(PYTHON[0], names)
    user = names["estimate"].users["user"]
    assert user.status == "found"
    truth = names["measurement"].truth.user_position["user"]
    assert np.linalg.norm(user.position - truth) < 1e-3  # what slam_2d promises of every seed
    plt.close("all")


def test_every_name_in_python_that_the_readme_tells_exists() -> None:
    told = README.split("In Python they are")[1].split("The commands call")[0]
    for name in re.findall(r"`(?:mmslam\.)?(\w+)`", told):
        assert name in mmslam.__all__


def test_the_readmes_way_to_write_a_measurement_is_read_by_locate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = PYTHON[1]
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(3)
    samples = rng.normal(size=(4, 5)) + 1j * rng.normal(size=(4, 5))
    positions = np.stack([np.arange(4) * 5e-4, np.zeros(4), np.zeros(4)], axis=-1)
    given = {
        "s11": samples,
        "s21": 2 * samples,
        "positions": positions,
        "frequencies": np.linspace(220e9, 221e9, 5),
    }
    exec(code, given)
    measurement = read_measurement(tmp_path / "sweep.zarr")
    assert measurement.echo is not None
    np.testing.assert_array_equal(measurement.echo.samples, samples)
    np.testing.assert_array_equal(measurement.uplinks[0].samples, 2 * samples)


def test_every_command_and_option_that_the_readme_names_exists() -> None:
    commands = [
        command.name or getattr(command.callback, "__name__", "")
        for command in app.registered_commands
    ]
    assert set(re.findall(r"^\| `mmslam (\w+)", README, flags=re.MULTILINE)) == set(commands)
    helps = " ".join(CliRunner().invoke(app, [name, "--help"]).stdout for name in commands)
    helps += CliRunner().invoke(app, ["--help"]).stdout
    plain = re.sub(r"\x1b\[[0-9;]*m", "", helps)  # colours split the names of options
    commands_section = README.split("## Commands, and")[1].split("## Your own data")[0]
    for option in sorted(set(re.findall(r"--[a-z]+", commands_section))):
        assert option in plain, option


def test_the_scenario_commands_of_the_readme_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(app, ["scenes", "slam_2d", "--export", "."]).exit_code == 0
    (tmp_path / "slam_2d.toml").rename("my_room.toml")
    assert CliRunner().invoke(app, ["scenes", "my_room.toml", "--show"]).exit_code == 0


def test_the_picture_is_there_and_small() -> None:
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", README)
    assert pictures == ["docs/images/slam_2d.png"]
    assert 10_000 < (CHECKOUT / pictures[0]).stat().st_size < 300_000
