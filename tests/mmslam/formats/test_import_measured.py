"""One measurement, written in every format by the example, is the same after each import."""

import runpy
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from estimator.localization.pipeline import locate
from estimator.measurement.model import MeasurementError
from estimator.measurement.store import read_measurement
from mmslam.cli import app
from mmslam.formats.export_touchstone import export_touchstone
from mmslam.formats.import_measured import Import, import_measured
from mmslam.formats.mapping import load_mapping

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "measured_data_files.py"

FORMATS = (
    "sweep.mat", "sweep_v73.mat", "sweep.h5", "sweep.nc", "sweep.csv", "sweep.npz", "s11.npy",
    "touchstone",
)  # fmt: skip

ROUNDING = 1e-10
"""Relative. The cable's phase, 2π·224 GHz·2.5 ns = 3500 rad, is known to 3500 · 2^-53 = 4e-13,
and the cross talk that is subtracted is thirty times the echo, so 1e-11; ten of it."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The example's files, and the variables of the script that wrote them."""
    folder = tmp_path_factory.mktemp("measured")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [str(EXAMPLE), str(folder)])
        return folder, runpy.run_path(str(EXAMPLE))


def take(folder: Path, name: str, mapping: str | None = None) -> Import:
    """Import one of the example's files, by its own mapping or by another text."""
    beside = folder / ("touchstone/mapping.toml" if name == "touchstone" else f"{name}.toml")
    if mapping is not None:
        beside = beside.with_name("changed.toml")
        beside.write_text(mapping, encoding="utf-8")
    return import_measured(folder / name, load_mapping(beside), base=beside.parent)


def text_of(folder: Path, name: str) -> str:
    return (folder / f"{name}.toml").read_text(encoding="utf-8")


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_closed_form_of_the_point_and_the_user(
    made: tuple[Path, dict[str, Any]], name: str
) -> None:
    folder, script = made
    imported = take(folder, name)
    measurement = imported.measurement
    assert imported.notes == ()
    assert measurement.echo is not None
    (uplink,) = measurement.uplinks
    assert relative(measurement.echo.samples, script["echo"]) < ROUNDING
    assert relative(uplink.samples, script["pilot"]) < ROUNDING
    assert (uplink.user, measurement.clock_offset, measurement.waves) == ("user", 0.0, "spherical")
    for data in (measurement.echo, uplink):
        # Half a micrometre in the file is the nearest double in metres too.
        np.testing.assert_array_equal(data.positions, script["position"])
        np.testing.assert_allclose(data.frequencies, script["frequency"], rtol=2**-52)


def test_the_command_writes_what_locate_reads_and_finds_a_folders_own_mapping(
    made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    folder, script = made
    store = tmp_path / "scan.zarr"
    done = CliRunner().invoke(app, ["import", str(folder / "touchstone"), "-o", str(store)])
    assert done.exit_code == 0, done.output
    read = read_measurement(store)
    assert read.echo is not None
    assert relative(read.echo.samples, script["echo"]) < ROUNDING


def test_a_scan_over_a_grid_has_its_axes_unfolded(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    samples = rng.normal(size=(5, 3, 4)) + 1j * rng.normal(size=(5, 3, 4))  # frequency, z, x
    x, z = np.arange(4) * 0.5, np.arange(3) * 0.7
    np.savez(tmp_path / "plane.npz", s=samples, f=220 + 0.1 * np.arange(5.0), x=x, z=z)
    mapping = """
        frequency = { variable = "f", unit = "GHz" }
        positions = { x = "x", y = 4.0, z = "z", origin = [0.5, 4.0, 0.0], unit = "mm" }
        echo = { variable = "s", axes = ["frequency", "z", "x"] }
    """
    echo = take(tmp_path, "plane.npz", mapping).measurement.echo
    assert echo is not None
    for place, spectrum in zip(echo.positions, echo.samples, strict=True):
        column, row = round(place[0] * 1e3 / 0.5) + 1, round(place[2] * 1e3 / 0.7)
        np.testing.assert_array_equal(spectrum, samples[:, row, column])
        assert place[1] == 0.0


def test_the_transmitter_of_two_horns_stands_beside_the_receiver(
    made: tuple[Path, dict[str, Any]],
) -> None:
    folder, script = made
    mapping = text_of(folder, "sweep.npz").replace(
        "[echo]", "[echo]\ntransmit_offset_m = [0.03, 0.0, 0.01]"
    )
    echo = take(folder, "sweep.npz", mapping).measurement.echo
    assert echo is not None
    assert echo.transmit_positions is not None
    np.testing.assert_allclose(
        echo.transmit_positions - script["position"], [[0.03, 0.0, 0.01]] * 16, atol=1e-17
    )


def test_transmit_positions_are_read_from_variables_of_their_own(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    samples = rng.normal(size=(4, 5)) + 1j * rng.normal(size=(4, 5))
    line = np.arange(4) * 0.5
    np.savez(tmp_path / "pair.npz", s=samples, rx=line, tx=line + 30.0)
    mapping = """
        frequency = { start = 220.0, stop = 221.0, points = 5, unit = "GHz" }
        positions = { x = "rx", unit = "mm" }
        [echo]
        variable = "s"
        transmit_positions = { x = "tx", unit = "mm" }
    """
    echo = take(tmp_path, "pair.npz", mapping).measurement.echo
    assert echo is not None
    assert echo.transmit_positions is not None
    np.testing.assert_allclose(echo.transmit_positions[:, 0] - echo.positions[:, 0], 0.03)


def test_the_wrong_sign_is_remarked_by_its_negative_delays(
    made: tuple[Path, dict[str, Any]],
) -> None:
    folder, _ = made
    # 0.8 m of echo in 3 m of unambiguous path lie in the lower half, or else in the upper.
    mapping = text_of(folder, "sweep.mat").replace("exp(-jwt)", "exp(+jwt)")
    mapping = mapping.replace("cable_delay_ns = 2.5", "cable_delay_ns = -2.5")
    notes = take(folder, "sweep.mat", mapping).notes
    assert any("echo" in note and "time_convention" in note for note in notes)


def test_decibels_taken_for_amplitudes_are_remarked(made: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = made
    mapping = text_of(folder, "sweep.csv").replace("magnitude_db", "magnitude")
    mapping = mapping.replace('background = { file = "sweep_empty.csv" }', "")
    assert any("decibels" in note for note in take(folder, "sweep.csv", mapping).notes)


def test_rounded_frequencies_are_put_onto_the_equal_grid_they_came_from(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    even = np.linspace(220e9, 221e9, 8)  # 142.857… MHz apart
    samples = 0.1 * (rng.normal(size=(4, 8)) + 1j * rng.normal(size=(4, 8)))
    np.savez(tmp_path / "rounded.npz", s=samples, f=np.round(even, -3))  # to a kilohertz
    mapping = """
        frequency = { variable = "f", unit = "Hz" }
        positions = { first = [0.0, 0.0, 0.0], step = [0.5, 0.0, 0.0], unit = "mm" }
        echo = { variable = "s" }
    """
    untold = take(tmp_path, "rounded.npz", mapping)
    assert any("not quite uniform" in note for note in untold.notes)
    told = take(tmp_path, "rounded.npz", f"frequency_rounded_to_hz = 1e3\n{mapping}")
    assert not told.notes
    for imported in (untold, told):
        echo = imported.measurement.echo
        assert echo is not None
        assert np.abs(echo.frequencies - even).max() <= 500.0  # its ends are rounded by half a kHz
        assert np.ptp(np.diff(echo.frequencies)) < 1e-3
        np.testing.assert_array_equal(echo.samples, samples)


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("sweep.npz", '"freq", unit = "Hz"', '"freq", unit = "GHz"', r"must be 1e\+07 … 1e\+13 Hz"),
        ("sweep.mat", 'unit = "GHz"', 'unit = "Hz"', r"220 … 224 Hz; they must be .* unit = 'Hz'"),
        ("sweep.mat", 'unit = "mm"', 'unit = "m"', r"500 mm apart, 374 wavelengths.*unit = 'm'"),
        ("sweep.npz", '"pos", unit = "m"', '"pos", unit = "mm"', "smaller than the wavelength"),
        ("sweep.mat", '"frequency", "position"', '"position", "frequency"', "but there are 41"),
        ("sweep.npz", '"s11"', '"s12"', r"no array 's12' \(found: empty, freq, pos, s11, s21\)"),
        ("sweep.mat", "sweep.S11", "sweep.S12", "no field 'S12'"),
        ("sweep.mat", '"sweep.S11"', '"sweep"', "is a MATLAB struct; .* name one of its fields"),
        ("sweep.mat", "sweep.x", "swoop.x", r"no variable 'swoop' \(found: sweep\)"),
        ("sweep_v73.mat", "sweep.S11", "sweep.S12", "no dataset 'sweep/S12'"),
        ("sweep_v73.mat", '"sweep.S11"', '"sweep"', "is a group; name a dataset in it"),
        ("sweep.h5", '"radar/echo"', '"radar/none"', "found: frequency, position, radar/echo"),
        ("sweep.h5", "run = 1", "run = 2", "run = 2, but that axis has 2 entries; choose 0…1"),
        ("sweep.h5", "take = { run = 1 }", "", r"axes besides position and frequency are \['run'"),
        ("sweep.h5", '["run", ', "[", "axes besides position and frequency are"),
        ("sweep.h5", "[\"axis\", \"position\"]", "[\"position\", \"axis\"]", "need x, y and z"),
        ("sweep.nc", '"s11_re"', '"s12_re"', "no variable 's12_re'"),
        ("sweep.nc", '"s11_im"', '"x"', "'x' has shape|has shape .* name each axis"),
        ("sweep.nc", '{ x = "x",', '{ y = "x",', "x has no variable, but the samples have 16"),
        ("sweep.nc", "points = 41", "points = 40", "41 frequencies, but there are 40"),
        ("sweep.csv", '"f_ghz"', '"f_mhz"', "41 rows for x_mm = -3.75"),
        ("sweep.csv", '"x_mm"', '"s11_db"', "no row for"),
        ("sweep.csv", '"s21_re"', '"s21"', "no column 's21'"),
        ("s11.npy", "s21.npy", "none.npy", "none.npy: no such file"),
        ("s11.npy", "freq.npy", "pos.npy", "must be one row of numbers"),
        ("s11.npy", "empty.npy", "freq.npy", "has shape .* name each axis"),
        ("sweep.npz", '"empty"', '"s11"', "all samples are zero"),
    ],
)  # fmt: skip
def test_a_mapping_that_does_not_fit_the_data_is_told_with_file_value_and_remedy(
    made: tuple[Path, dict[str, Any]], name: str, old: str, new: str, message: str
) -> None:
    folder, _ = made
    mapping = text_of(folder, name)
    assert old in mapping
    with pytest.raises(MeasurementError, match=message):
        take(folder, name, mapping.replace(old, new))


def test_an_array_of_unusual_size_is_accepted_when_the_mapping_says_so(
    made: tuple[Path, dict[str, Any]],
) -> None:
    folder, _ = made
    mapping = text_of(folder, "sweep.mat").replace('unit = "mm"', 'unit = "m", any_size = true')
    echo = take(folder, "sweep.mat", mapping).measurement.echo
    assert echo is not None
    assert np.ptp(echo.positions[:, 0]) == 7.5


def test_equal_numbers_of_positions_and_frequencies_need_their_order(tmp_path: Path) -> None:
    np.save(tmp_path / "square.npy", np.exp(1j * np.arange(16.0)).reshape(4, 4))
    mapping = """
        frequency = { start = 220.0, stop = 221.0, points = 4, unit = "GHz" }
        positions = { first = [0.0, 0.0, 0.0], step = [0.5, 0.0, 0.0], unit = "mm" }
        [echo]
    """
    with pytest.raises(MeasurementError, match="either axis could be the frequency"):
        take(tmp_path, "square.npy", mapping)
    ordered = take(tmp_path, "square.npy", f'{mapping}\naxes = ["frequency", "position"]')
    assert ordered.measurement.echo is not None
    np.testing.assert_array_equal(
        ordered.measurement.echo.samples, np.load(tmp_path / "square.npy").T
    )


def test_the_background_must_be_of_the_same_positions(made: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = made
    moved = np.load(folder / "pos.npy") + np.array([1e-4, 0, 0])
    arrays = dict(np.load(folder / "sweep.npz")) | {"pos": moved}
    np.savez(folder / "moved.npz", allow_pickle=False, **arrays)
    mapping = text_of(folder, "sweep.npz").replace(
        '{ variable = "empty" }', '{ file = "moved.npz", variable = "empty" }'
    )
    with pytest.raises(MeasurementError, match="background: its positions differ"):
        take(folder, "sweep.npz", mapping)


def test_without_a_mapping_measured_data_is_refused_with_the_remedy(tmp_path: Path) -> None:
    (tmp_path / "sweep.mat").touch()
    for source in ("folder", "sweep.mat"):
        (tmp_path / "folder").mkdir(exist_ok=True)
        done = CliRunner().invoke(
            app, ["import", str(tmp_path / source), "-o", str(tmp_path / "out.zarr")]
        )
        assert done.exit_code == 2
        assert "--mapping" in done.output
        assert not (tmp_path / "out.zarr").exists()


def test_the_tutorials_folder_is_imported_as_it_says(
    made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    folder, script = made
    tutorial = (EXAMPLE.parents[1] / "docs" / "measured_data.md").read_text(encoding="utf-8")
    mapping = tutorial.split("```toml\n")[1].split("```")[0]
    for name in ("scan", "empty"):
        shutil.copytree(folder / "touchstone" / name, tmp_path / name)
    imported = take(tmp_path, "scan", mapping).measurement
    assert imported.echo is not None
    assert relative(imported.echo.samples, script["echo"]) < ROUNDING


def test_every_mapping_of_the_tutorial_is_valid(tmp_path: Path) -> None:
    tutorial = (EXAMPLE.parents[1] / "docs" / "measured_data.md").read_text(encoding="utf-8")
    whole = [text.split("```")[0] for text in tutorial.split("```toml\n")[1:]]
    complete = [text for text in whole if "positions" in text]
    assert len(complete) == 3
    for text in complete:
        (tmp_path / "mapping.toml").write_text(text, encoding="utf-8")
        load_mapping(tmp_path / "mapping.toml")


@pytest.mark.parametrize(
    ("name", "variable", "value", "message"),
    [
        (
            "sweep.npz",
            "s21",
            1e200,
            r"uplinks\.user: samples reach 1e\+200; counts of a converter are",
        ),
        ("sweep.npz", "pos", 1e300, "a coordinate of .* it must be at most 1000 m"),
        ("sweep.npz", "freq", 1e300, r"must be 1e\+07 … 1e\+13 Hz"),
        ("sweep.npz", "pos", np.nan, "1 of 48 values of 'pos' are NaN"),
        ("sweep.npz", "s11", np.nan, "1 of 656 values are NaN"),
        ("sweep.npz", "freq", 223.99e9, "not uniform|do not increase"),
    ],
)
def test_a_damaged_number_is_refused_before_it_is_computed_with(
    made: tuple[Path, dict[str, Any]],
    tmp_path: Path,
    name: str,
    variable: str,
    value: float,
    message: str,
) -> None:
    folder, _ = made
    arrays = dict(np.load(folder / name))
    arrays[variable] = arrays[variable].copy()
    arrays[variable].flat[7] = value
    np.savez(tmp_path / name, allow_pickle=False, **arrays)
    with pytest.raises(MeasurementError, match=message):
        take(tmp_path, name, text_of(folder, name))


def test_an_empty_array_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "none.npz", s=np.zeros((0, 4), dtype=complex))
    mapping = """
        frequency = { start = 220.0, stop = 221.0, points = 4, unit = "GHz" }
        positions = { first = [0.0, 0.0, 0.0], step = [0.5, 0.0, 0.0], unit = "mm" }
        echo = { variable = "s" }
    """
    with pytest.raises(MeasurementError, match=r"'s' is empty \(shape \(0, 4\)\)"):
        take(tmp_path, "none.npz", mapping)


def test_the_examples_user_is_located_where_the_closed_form_put_it_and_again_after_export(
    made: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    folder, script = made
    first = take(folder, "touchstone").measurement
    export_touchstone(first, tmp_path / "out")
    mapping = load_mapping(tmp_path / "out" / "mapping.toml")
    again = import_measured(tmp_path / "out", mapping, base=tmp_path / "out").measurement
    found = [locate(measurement).users[0].position for measurement in (first, again)]
    assert found[0] is not None
    assert found[1] is not None
    # Without noise the fit of a spherical wave ends within its own tolerance, far below 1 µm.
    np.testing.assert_allclose(found[0], script["user"], atol=1e-6)
    np.testing.assert_array_equal(found[1], found[0])
