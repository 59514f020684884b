"""Tables and lists as people and instruments write them: each gives one point's echo."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py  # type: ignore[import-untyped]
import numpy as np
import pytest
from scipy.constants import speed_of_light

import mmslam
from estimator.measurement.model import Echo, MeasurementError

TARGET = np.array([0.011, 0.19, 0.006])  # [m]
FREQUENCIES = np.linspace(30e9, 34e9, 14)  # [Hz]
BAND = {"start": 30.0, "stop": 34.0, "points": 14, "unit": "GHz"}
X, Z = 1e-3 * np.array([-7.0, -3.0, 1.0, 5.0]), 1e-3 * np.array([-4.0, 0.0, 4.0])

DIGITS = 1e-8
"""Relative to the echo: nine digits are written. [-]"""


def echo_of(positions: np.ndarray) -> np.ndarray:
    distance = np.linalg.norm(positions - TARGET, axis=1)[:, None]
    return np.asarray(0.1 * np.exp(-4j * np.pi * FREQUENCIES * distance / speed_of_light))


PLACES = np.array([[x, 0.0, z] for z in Z for x in X])  # [m]
SAMPLES = echo_of(PLACES)
MAPPING: dict[str, Any] = {
    "frequency": {"variable": "f", "unit": "GHz"},
    "positions": {"x": "x", "z": "z", "unit": "mm"},
}


def taken(source: Path, mapping: dict[str, Any]) -> Echo:
    echo = mmslam.import_measured(source, mapping).echo
    assert echo is not None
    return echo


def assert_is_the_point(echo: Echo, tolerance: float = DIGITS) -> None:
    assert len(echo.positions) == len(PLACES)
    assert {tuple(row) for row in np.round(echo.positions, 9)} == {
        tuple(row) for row in np.round(PLACES, 9)
    }
    np.testing.assert_allclose(echo.samples, echo_of(echo.positions), rtol=0, atol=0.1 * tolerance)


def rows(write: Callable[[complex], str], separator: str = ",", point: str = ".") -> str:
    lines = []
    for place, sweep in zip(PLACES, SAMPLES, strict=True):
        for frequency, value in zip(FREQUENCIES, sweep, strict=True):
            numbers = [frequency / 1e9, 1e3 * place[0], 1e3 * place[2]]
            fields = [f"{number:.10g}" for number in numbers] + [write(value)]
            lines.append(separator.join(fields).replace(".", point))
    return "\n".join(lines) + "\n"


def parts(value: complex) -> str:
    return f"{value.real:.10g},{value.imag:.10g}"


@pytest.mark.parametrize(
    "write",
    [
        lambda v: f"{v.real:.10g}{v.imag:+.10g}i",
        lambda v: f"({v.real:.10g}{v.imag:+.10g}j)",
        lambda v: f"{v.real:.10g} {'+' if v.imag >= 0 else '-'} {abs(v.imag):.10g}i",
    ],
)
def test_complex_numbers_may_stand_in_one_column(
    tmp_path: Path, write: Callable[[complex], str]
) -> None:
    (tmp_path / "s.csv").write_text("f,x,z,S11\n" + rows(write), encoding="utf-8")
    assert_is_the_point(taken(tmp_path / "s.csv", MAPPING | {"echo": {"variable": "S11"}}))


def test_a_line_of_units_and_the_frame_of_an_analyser_are_no_numbers(tmp_path: Path) -> None:
    text = "! SN 1\nBEGIN CH1_DATA\nf,x,z,re,im\nGHz,mm,mm,-,-\n" + rows(parts) + "END\n"
    (tmp_path / "s.csv").write_text(text, encoding="utf-8")
    named = MAPPING | {"echo": {"real": "re", "imaginary": "im"}}
    assert_is_the_point(taken(tmp_path / "s.csv", named))


@pytest.mark.parametrize("code", ["cp1252", "utf-16", "utf-8-sig"])
def test_a_german_table_of_decibels_and_degrees_is_read_in_any_code(
    tmp_path: Path, code: str
) -> None:
    def write(value: complex) -> str:
        return f"{20 * np.log10(abs(value)):.12g};{np.degrees(np.angle(value)):.12g}"

    text = "# für Länge\nf;x;z;|S11| [dB];Phase [°]\n" + rows(write, ";", ",")
    (tmp_path / "s.csv").write_text(text, encoding=code)
    named = {"magnitude_db": "|S11| [dB]", "phase_deg": "Phase [°]"}
    assert_is_the_point(taken(tmp_path / "s.csv", MAPPING | {"echo": named}))
    swapped = {"magnitude_db": "|S11| [dB]", "phase_rad": "Phase [°]"}
    with pytest.raises(MeasurementError, match=r"phase_rad lies between .* name it by phase_deg"):
        taken(tmp_path / "s.csv", MAPPING | {"echo": swapped})


def test_phases_that_fill_a_turn_of_radians_are_no_degrees(tmp_path: Path) -> None:
    np.savez(tmp_path / "s.npz", a=np.abs(SAMPLES), p=np.angle(SAMPLES), xyz=PLACES)
    mapping = {"frequency": BAND, "positions": {"variable": "xyz", "unit": "m"}}
    right = mapping | {"echo": {"magnitude": "a", "phase_rad": "p"}}
    assert_is_the_point(taken(tmp_path / "s.npz", right))
    with pytest.raises(MeasurementError, match=r"phase_deg lies between .* name it by phase_rad"):
        taken(tmp_path / "s.npz", mapping | {"echo": {"magnitude": "a", "phase_deg": "p"}})


def test_binary_data_are_no_text(tmp_path: Path) -> None:
    (tmp_path / "s.csv").write_bytes(b"PK\x03\x04\x00\x00junk")
    with pytest.raises(MeasurementError, match=r"s.csv: cannot be read as text \(it holds binary"):
        taken(tmp_path / "s.csv", MAPPING | {"echo": {"variable": "S11"}})


def test_inches_and_axes_of_length_one_need_no_detour(tmp_path: Path) -> None:
    cube = SAMPLES.reshape(1, 3, 4, 14, 1)
    np.savez(tmp_path / "s.npz", S=cube, x=X / 25.4e-3, z=Z / 25.4e-3)
    mapping = {
        "frequency": BAND,
        "positions": {"x": "x", "z": "z", "unit": "in"},
        "echo": {"variable": "S", "axes": ["z", "x", "frequency"]},
    }
    assert_is_the_point(taken(tmp_path / "s.npz", mapping))


def test_a_scanner_that_moves_there_and_back_is_put_in_order(tmp_path: Path) -> None:
    grid = SAMPLES.reshape(3, 4, 14).copy()
    grid[1] = grid[1, ::-1]
    np.savez(tmp_path / "s.npz", S=grid, x=1e3 * X, z=1e3 * Z)
    mapping = {
        "frequency": BAND,
        "positions": {"x": "x", "z": "z", "unit": "mm", "snake": True},
        "echo": {"variable": "S", "axes": ["z", "x", "frequency"]},
    }
    assert_is_the_point(taken(tmp_path / "s.npz", mapping))
    np.savez(tmp_path / "l.npz", S=SAMPLES, x=1e3 * PLACES[:, 0], z=1e3 * PLACES[:, 2])
    with pytest.raises(MeasurementError, match="snake = true needs a grid of two axes"):
        taken(tmp_path / "l.npz", mapping | {"echo": {"variable": "S"}})


def test_records_of_i_and_q_are_complex_numbers(tmp_path: Path) -> None:
    records = np.zeros(SAMPLES.shape, dtype=[("I", "<i2"), ("Q", "<i2")])
    records["I"], records["Q"] = np.rint(1e5 * SAMPLES.real), np.rint(1e5 * SAMPLES.imag)
    np.save(tmp_path / "s.npy", records)
    np.savetxt(tmp_path / "x.txt", 1e3 * PLACES[:, 0])
    np.savetxt(tmp_path / "z.txt", 1e3 * PLACES[:, 2])
    mapping = {
        "frequency": BAND,
        "positions": {
            "x": {"file": str(tmp_path / "x.txt")},
            "z": {"file": str(tmp_path / "z.txt")},
            "unit": "mm",
        },
        "echo": {"scale": 1e-5},
    }
    # a count of 1e-5 in 0.1, halved by rounding
    assert_is_the_point(taken(tmp_path / "s.npy", mapping), tolerance=1e-4)


def test_angles_of_an_arm_and_of_a_turntable_place_the_antenna_on_a_circle(
    tmp_path: Path,
) -> None:
    angle = np.arange(0.0, 360.0, 15.0)
    turn = np.deg2rad(angle)
    circle = 0.25 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    np.savez(tmp_path / "s.npz", S=echo_of(circle), arm=angle, table=-angle)
    for key in ("arm", "table"):
        mapping = {
            "frequency": BAND,
            "positions": {
                "azimuth_deg": key,
                "radius": 250.0,
                "unit": "mm",
                "turntable": key == "table",
            },
            "echo": {"variable": "S"},
        }
        np.testing.assert_allclose(taken(tmp_path / "s.npz", mapping).positions, circle, atol=1e-12)
    with pytest.raises(MeasurementError, match="azimuth_deg and radius belong together"):
        taken(
            tmp_path / "s.npz",
            mapping | {"positions": {"azimuth_deg": "arm", "unit": "mm"}},
        )


def test_a_cylinder_is_a_grid_of_angles_and_heights(tmp_path: Path) -> None:
    angle, heights = np.arange(0.0, 360.0, 30.0), np.array([-0.05, 0.0, 0.05])
    samples = np.ones((12, 3, 14)) * np.exp(1j * np.arange(12))[:, None, None] * 0.1
    np.savez(tmp_path / "s.npz", S=samples, a=angle, h=heights)
    mapping: dict[str, Any] = {
        "frequency": BAND,
        "positions": {"azimuth_deg": "a", "radius": 0.3, "z": "h", "unit": "m"},
        "echo": {"variable": "S", "axes": ["azimuth", "z", "frequency"]},
    }
    places = taken(tmp_path / "s.npz", mapping).positions
    np.testing.assert_allclose(np.hypot(places[:, 0], places[:, 1]), 0.3)
    np.testing.assert_allclose(places[:3, 2], heights)
    steps = {"first": [0.0, 0.0, 0.0], "step": [1.0, 0.0, 0.0], "unit": "mm"}
    with pytest.raises(MeasurementError, match="give azimuth_deg, radius and z"):
        taken(tmp_path / "s.npz", mapping | {"positions": steps})


def test_folders_in_folders_and_lists_with_semicolons_tell_positions(tmp_path: Path) -> None:
    lines = ["# by hand", "file;x;y;z"]
    for number, (place, sweep) in enumerate(zip(PLACES, SAMPLES, strict=True)):
        part = tmp_path / "scan" / f"z{1e3 * place[2]:+.0f}"
        part.mkdir(parents=True, exist_ok=True)
        text = "# GHz S RI R 50\n" + "".join(
            f"{f / 1e9:.9g} {v.real:.10g} {v.imag:.10g}\n"
            for f, v in zip(FREQUENCIES, sweep, strict=True)
        )
        (part / f"x{1e3 * place[0]:+.0f}.s1p").write_text(text, encoding="ascii")
        flat = tmp_path / "flat"
        flat.mkdir(exist_ok=True)
        (flat / f"m{number}.s1p").write_text(text, encoding="ascii")
        lines.append(f"m{number}.s1p;{100 * place[0]:.9g};0;{100 * place[2]:.9g}".replace(".", ","))
    deep = {"files": "z{z}/x{x}.s1p", "unit": "mm", "any_size": True}
    echo = {"parameter": "S11"}
    assert_is_the_point(taken(tmp_path / "scan", {"positions": deep, "echo": echo}))
    (flat / "list.csv").write_text("\n".join(lines).replace(",s1p", ".s1p"), encoding="utf-8")
    listed = {"csv": "list.csv", "unit": "cm"}
    assert_is_the_point(taken(flat, {"positions": listed, "echo": echo}))


def test_a_matrix_of_matlab_73_keeps_the_axes_that_matlab_shows(tmp_path: Path) -> None:
    shown = SAMPLES.reshape(3, 4, 14)
    pairs = np.zeros(shown.T.shape, dtype=[("real", "<f8"), ("imag", "<f8")])
    pairs["real"], pairs["imag"] = shown.T.real, shown.T.imag
    path = tmp_path / "s.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("scan")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in (("S11", pairs), ("x", X[:, None]), ("z", Z[:, None])):
            group.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, HDF5 schema 1.00 .".ljust(124) + b"\x00\x02IM")
    mapping = {
        "frequency": BAND,
        "positions": {"x": "scan.x", "z": "scan.z", "unit": "m"},
        "echo": {"variable": "scan.S11", "axes": ["z", "x", "frequency"]},
    }
    assert_is_the_point(taken(path, mapping))
