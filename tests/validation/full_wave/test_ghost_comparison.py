"""Ghosts of two cylinders behind a rough wall against the method of moments."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from estimator.measurement.model import MeasurementError
from validation.full_wave.ghost_comparison import compare_ghosts, main
from validation.reference import ROUGH_WALL

DATA = ROUGH_WALL.parent
EVERY = {"positions": 3, "frequencies": 4}  # of what is stored: a quarter of the time

Arrays = dict[str, np.ndarray]


def stored(name: str) -> Arrays:
    with np.load(DATA / name, allow_pickle=False) as archive:
        arrays = {key: np.asarray(archive[key]) for key in archive.files}
    for key in [key for key in arrays if key == "echo" or key.startswith("uplink")]:
        arrays[key] = arrays[key][:: EVERY["positions"], :: EVERY["frequencies"]]
    arrays["aperture_position"] = arrays["aperture_position"][:: EVERY["positions"]]
    arrays["frequency"] = arrays["frequency"][:: EVERY["frequencies"]]
    return arrays


@pytest.fixture(scope="module")
def two() -> Arrays:
    return stored("two_cylinders_decimated.npz")


@pytest.fixture(scope="module")
def wall() -> Arrays:
    return stored("rough_wall_decimated.npz")


def written(folder: Path, two: Arrays, wall: Arrays) -> tuple[Path, Path]:
    paths = folder / "two.npz", folder / "wall.npz"
    for path, arrays in zip(paths, (two, wall), strict=True):
        np.savez(path, allow_pickle=False, **arrays)
    return paths


def test_the_ghosts_agree_with_the_full_wave_solution(
    two: Arrays, wall: Arrays, tmp_path: Path
) -> None:
    correlation, level_db = compare_ghosts(*written(tmp_path, two, wall))
    assert correlation >= 0.97  # the limits; 0.986 and -0.65 dB at full size
    assert abs(level_db) <= 1.5


def test_behind_another_wall_they_do_not(two: Arrays, wall: Arrays, tmp_path: Path) -> None:
    # The same wall from its other end: as rough, and a mirror in the same place.
    profile, across = wall["wall_profile"], np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    heights = (profile - profile[0]) @ across
    turned = profile + (heights[::-1] - heights)[:, None] * across
    other = {**wall, "wall_profile": turned}
    correlation, _ = compare_ghosts(*written(tmp_path, two, other))
    assert correlation < 0.9


@pytest.mark.parametrize(("factor", "code", "verdict"), [(1.0, 0, "pass"), (2.0, 1, "FAIL")])
def test_the_command_says_how_it_went(
    factor: float,
    code: int,
    verdict: str,
    two: Arrays,
    wall: Arrays,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    louder = {**two, "echo": wall["echo"] + factor * (two["echo"] - wall["echo"])}
    paths = written(tmp_path, louder, wall)
    monkeypatch.setattr(sys, "argv", ["full_wave_ghosts", *map(str, paths)])
    assert main() == code
    assert verdict in capsys.readouterr().out


def test_the_command_wants_two_files(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["full_wave_ghosts", "one.npz"])
    assert main() == 2
    assert (
        "python -m validation.full_wave.ghost_comparison TWO.npz WALL.npz"
        in capsys.readouterr().err
    )


def test_the_command_runs_as_a_module() -> None:
    # In a process of its own: run here, its bytecode would be kept with the runtime checks in it.
    command = [sys.executable, "-m", "validation.full_wave.ghost_comparison", *2 * ["missing.npz"]]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert "missing.npz" in ended.stderr


def without(name: str) -> Callable[[Arrays], Arrays]:
    return lambda arrays: {key: value for key, value in arrays.items() if key != name}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without("cylinder_centre"), "cylinder_centre missing"),
        (without("echo"), "echo missing"),
        (
            lambda arrays: {**arrays, "cylinder_radius": arrays["cylinder_radius"][:1]},
            r"must be \(n, 3\) and \(n,\)",
        ),
        (
            lambda arrays: {**arrays, "frequency": arrays["frequency"] + 1e9},
            "'frequency' is not that of the wall's file",
        ),
        (lambda arrays: {**arrays, "echo": arrays["echo"][1:]}, "'echo' has shape"),
    ],
)
def test_a_file_of_other_cylinders_or_another_radio_is_refused(
    change: Callable[[Arrays], Arrays], message: str, two: Arrays, wall: Arrays, tmp_path: Path
) -> None:
    paths = written(tmp_path, change(two), wall)
    with pytest.raises(MeasurementError, match=message):
        compare_ghosts(*paths)


def test_a_file_that_is_no_archive_is_refused(wall: Arrays, tmp_path: Path) -> None:
    _, wall_path = written(tmp_path, wall, wall)
    (tmp_path / "text.npz").write_text("x y z")
    with pytest.raises(MeasurementError, match=r"text\.npz: not an \.npz of plain arrays"):
        compare_ghosts(tmp_path / "text.npz", wall_path)
