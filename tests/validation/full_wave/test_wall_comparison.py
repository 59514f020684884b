"""Physical optics against the method of moments, and files that are no such reference."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.measurement.model import MeasurementError
from validation.full_wave.wall_comparison import (
    BEAM_PARAMETER,
    Agreement,
    compare_with_full_wave,
    complex_source_beam,
    main,
    read_reference,
)
from validation.reference import ROUGH_WALL

REFERENCE = ROUGH_WALL


def save(path: Path, arrays: dict[str, Any]) -> None:
    np.savez(path, **arrays)


@pytest.fixture(scope="module")
def arrays() -> dict[str, np.ndarray]:
    return read_reference(REFERENCE)


def test_physical_optics_on_the_true_profile_agrees_with_the_full_wave_solution() -> None:
    agreements = {one.name: one for one in compare_with_full_wave(REFERENCE)}
    assert set(agreements) == {"echo", "uplink_isotropic", "uplink_beam"}
    for one in agreements.values():
        assert one.correlation >= 0.99, one  # the limits
        assert abs(one.level_db) <= 2.0, one
        assert one.passed


def test_another_wall_does_not_agree(arrays: dict[str, np.ndarray], tmp_path: Path) -> None:
    # The same wall from its other end: all statistics are equal, the realisation is not.
    wall = arrays["wall_profile"]
    heights = (wall - wall[0]) @ np.array([1, -1, 0]) / np.sqrt(2)
    flat = wall - heights[:, None] * np.array([1, -1, 0]) / np.sqrt(2)
    turned = flat + heights[::-1, None] * np.array([1, -1, 0]) / np.sqrt(2)
    changed = {**arrays, "wall_profile": turned}
    save(tmp_path / "other.npz", changed)
    echo = compare_with_full_wave(tmp_path / "other.npz")[0]
    assert echo.name == "echo"
    assert not echo.passed
    assert echo.correlation < 0.3


def test_the_command_says_pass_and_succeeds(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["full_wave_reference", str(REFERENCE)])
    assert main() == 0
    assert capsys.readouterr().out.count("pass") == 3


def test_the_command_says_fail_and_fails(
    arrays: dict[str, np.ndarray],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    geometry = {name: arrays[name] for name in ("wall_profile", "aperture_position", "frequency")}
    save(tmp_path / "loud.npz", {**geometry, "echo": 2 * arrays["echo"]})
    monkeypatch.setattr(sys, "argv", ["full_wave_reference", str(tmp_path / "loud.npz")])
    assert main() == 1
    printed = capsys.readouterr().out
    assert printed.count("FAIL") == 1
    assert "level -" in printed  # 6 dB too low, as the reference was doubled


def test_the_command_wants_one_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["full_wave_reference"])
    assert main() == 2
    assert "python -m validation.full_wave.wall_comparison FILE.npz" in capsys.readouterr().err


def test_the_command_runs_as_a_module() -> None:
    # In a process of its own: run here, its bytecode would be kept with the runtime checks in it.
    command = [sys.executable, "-m", "validation.full_wave.wall_comparison", "missing.npz"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert "missing.npz" in ended.stderr


def write_pickle(path: Path) -> None:
    np.savez(path, wall_profile=np.array([{"a": 1}], dtype=object))


def write_single_array(path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.zeros(3))


def write_truncated(path: Path) -> None:
    path.write_bytes(REFERENCE.read_bytes()[:5000])


def write_damaged(path: Path) -> None:
    whole = bytearray(REFERENCE.read_bytes())
    middle = len(whole) // 2
    whole[middle : middle + 2000] = bytes(2000)
    path.write_bytes(bytes(whole))


@pytest.mark.parametrize(
    "write",
    [
        pytest.param(lambda path: None, id="missing"),
        pytest.param(lambda path: path.mkdir(), id="folder"),
        pytest.param(lambda path: path.write_bytes(b""), id="empty"),
        pytest.param(lambda path: path.write_text("x y z"), id="text"),
        pytest.param(write_pickle, id="pickle"),
        pytest.param(write_single_array, id="npy"),
        pytest.param(write_truncated, id="truncated"),
        pytest.param(write_damaged, id="damaged"),
    ],
)
def test_a_file_that_is_no_archive_of_plain_arrays_is_refused(
    write: Callable[[Path], object], tmp_path: Path
) -> None:
    path = tmp_path / "foreign.npz"
    write(path)
    with pytest.raises(MeasurementError, match=r"foreign\.npz: not an \.npz of plain arrays"):
        read_reference(path)


@pytest.mark.parametrize(
    ("missing", "message"),
    [
        ("wall_profile", "wall_profile missing"),
        ("frequency", "frequency missing"),
        ("user_position", "user_position missing"),
    ],
)
def test_a_reference_without_an_array_is_refused_by_its_name(
    missing: str, message: str, arrays: dict[str, np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "part.npz"
    save(path, {name: values for name, values in arrays.items() if name != missing})
    with pytest.raises(MeasurementError, match=message):
        read_reference(path)


def test_a_reference_without_anything_to_compare_is_refused(
    arrays: dict[str, np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "geometry.npz"
    names = ("wall_profile", "aperture_position", "frequency")
    save(path, {name: arrays[name] for name in names})
    with pytest.raises(MeasurementError, match=r"echo, uplink_isotropic or uplink_beam"):
        read_reference(path)


def test_arrays_that_do_not_fit_each_other_are_refused(
    arrays: dict[str, np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "short.npz"
    save(path, {**arrays, "echo": arrays["echo"][:, :-1]})
    with pytest.raises(MeasurementError, match=r"'echo' has shape"):
        compare_with_full_wave(path)


def test_the_beam_solves_the_wave_equation_and_is_a_gaussian_about_its_aim() -> None:
    pattern = complex_source_beam(np.array([0.0, 2.0, 0.0]))
    frequencies = np.array([250e9])
    off_axis = np.linspace(-0.15, 0.15, 31)
    directions = np.stack([np.sin(off_axis), np.cos(off_axis), 0 * off_axis], axis=-1)
    far = 200.0
    field = pattern(directions, np.full(31, far), frequencies)[0]
    wavenumber = 2 * np.pi * 250e9 / speed_of_light
    # Far away: exp(-kb(1 - cos ψ)), a Gaussian of width 1/√(kb) near the axis.
    expected = np.exp(-wavenumber * BEAM_PARAMETER * (1 - np.cos(off_axis)))
    np.testing.assert_allclose(np.abs(field), expected, atol=2e-3)  # b/R = 5e-4, times k·b·ψ²
    assert abs(field[15]) == pytest.approx(1.0, abs=1e-3)
    # Helmholtz, by finite differences of the whole field near by, λ/60 apart.
    step = speed_of_light / 250e9 / 60

    def wave(points: np.ndarray) -> np.ndarray:
        distances = np.linalg.norm(points, axis=-1)
        gain = pattern(points / distances[:, None], distances, frequencies)[0]
        return np.asarray(gain * np.exp(-1j * wavenumber * distances) / np.sqrt(distances))

    middle = np.array([0.05, 0.4, 0.0])
    around = middle + step * np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    values = wave(around)
    laplacian = (values[1:].sum() - 4 * values[0]) / step**2
    # The stencil errs by (kh)²/12 = 9e-4, and the far form of the Hankel function by 1/(kr)².
    assert abs(laplacian + wavenumber**2 * values[0]) <= 2e-3 * wavenumber**2 * abs(values[0])


def test_the_limits_are_on_correlation_and_on_level_either_way() -> None:
    def agreement(correlation: float, level_db: float) -> bool:
        return Agreement(name="echo", correlation=correlation, level_db=level_db).passed

    assert agreement(0.99, -2.0)
    assert agreement(1.0, 2.0)
    assert not agreement(0.9899, 0.0)
    assert not agreement(1.0, 2.01)
    assert not agreement(1.0, -2.01)
