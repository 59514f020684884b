"""`mmslam simulate --full-wave`: the same file, told beforehand, or refused."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from estimator.measurement.store import read_measurement
from mmslam.cli import app
from validation.metrics.truth import read_truth

SMALL = (
    "waves=cylindrical",
    "noise.snr_db=inf",
    "radio.points=3",
    "base_station.elements=4",
    "objects.wall.length_m=0.015",
)


@pytest.fixture(autouse=True)
def away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def simulate(*options: str, overrides: tuple[str, ...] = SMALL) -> Result:
    told = [part for one in overrides for part in ("--set", one)]
    return CliRunner().invoke(app, ["simulate", "slam_2d", *options, *told])


def test_full_wave_writes_what_the_simulator_writes_and_says_first_what_it_takes() -> None:
    result = simulate("--full-wave", "-o", "full.zarr")
    assert result.exit_code == 0, result.output
    told, *_ = [one for one in result.stderr.splitlines() if not one.startswith("note: ")]
    assert told.startswith("full wave: ")
    assert "unknowns, 3 of 3 frequencies" in told
    assert simulate("-o", "rays.zarr").exit_code == 0
    full, rays = (read_measurement(Path(name)) for name in ("full.zarr", "rays.zarr"))
    assert full.waves == rays.waves == "cylindrical"
    assert full.echo is not None
    assert rays.echo is not None
    np.testing.assert_array_equal(full.echo.positions, rays.echo.positions)
    np.testing.assert_array_equal(full.echo.frequencies, rays.echo.frequencies)
    pilots = full.uplinks[0].samples, rays.uplinks[0].samples
    level = np.linalg.norm(pilots[0]) / np.linalg.norm(pilots[1])
    # Physical optics on the same heights; the edges are 15 mm apart.
    assert abs(20 * np.log10(level)) < 1.0
    assert list(read_truth(Path("full.zarr")).wall_start) == ["wall"]


def test_what_full_wave_cannot_solve_is_refused_before_any_work() -> None:
    result = simulate("--full-wave", "-o", "full.zarr", overrides=("objects.wall.length_m=0.4",))
    assert result.exit_code == 2
    assert "--set waves=cylindrical" in " ".join(result.stderr.split())
    long = ("waves=cylindrical", "objects.wall.length_m=8.0", "objects.wall.centre_m=[0.0, 4.0]")
    result = simulate("--full-wave", "-o", "full.zarr", overrides=long)
    assert result.exit_code == 2
    assert "unknowns" in result.stderr
    assert "make objects smaller" in " ".join(result.stderr.split())
    assert not Path("full.zarr").exists()
