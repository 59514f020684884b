import pickle
from pathlib import Path

import numpy as np
import pytest

from estimator.measurement.model import MeasurementError
from mmslam.formats.mapping import SweepMapping
from mmslam.formats.measured_signals import FolderReader
from mmslam.formats.tables.position_table import PositionTable
from mmslam.formats.touchstone_files import read_touchstone, touchstone_text
from mmslam.formats.touchstone_folder import list_folder, read_scan

FREQUENCY = np.linspace(220e9, 221e9, 5)


def sweep(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.asarray(rng.normal(size=5) + 1j * rng.normal(size=5))


def text(seed: int = 0, ports: int = 1) -> str:
    return touchstone_text(FREQUENCY, sweep(seed), ports=ports, comment="a sweep")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number, x in enumerate((-0.5, 0.0, 0.5, 1.0)):
        (tmp_path / f"x{x:+.1f}mm.s1p").write_text(text(number))
    return tmp_path


def table(**keys: object) -> PositionTable:
    return PositionTable.model_validate({"unit": "mm"} | keys)


def scan(folder: Path, pattern: str = "x{x}mm.s1p") -> np.ndarray:
    listed = list_folder(folder, table(files=pattern), base=folder)
    return read_scan(listed.files).parameter("S11")


def test_the_position_is_read_from_the_name_and_orders_the_scan(folder: Path) -> None:
    listed = list_folder(folder, table(files="x{x}mm.s1p"), base=folder)
    np.testing.assert_array_equal(listed.positions[:, 0], [-0.5e-3, 0.0, 0.5e-3, 1e-3])
    np.testing.assert_array_equal(listed.positions[:, 1:], 0.0)
    np.testing.assert_array_equal(scan(folder), [sweep(number) for number in range(4)])


def test_a_p_may_stand_for_the_decimal_point(tmp_path: Path) -> None:
    for x in ("-1p5", "2p25"):
        (tmp_path / f"z3_{x}.s1p").write_text(text())
    listed = list_folder(tmp_path, table(files="z{z}_{x}.s1p"), base=tmp_path)
    np.testing.assert_array_equal(listed.positions, [[-1.5e-3, 0, 3e-3], [2.25e-3, 0, 3e-3]])


def test_a_counted_scan_runs_along_the_given_line(tmp_path: Path) -> None:
    for number in (8, 9, 10):
        (tmp_path / f"scan{number}_{number * 7}.s1p").write_text(text(number))
    line = table(files="scan{index}_*.s1p", first=[1.0, 0.0, 0.0], step=[0.5, 0.0, 0.0])
    listed = list_folder(tmp_path, line, base=tmp_path)
    np.testing.assert_array_equal(listed.positions[:, 0], [1e-3, 1.5e-3, 2e-3])
    assert [path.name for path in listed.files][-1] == "scan10_70.s1p"  # 10 after 9, not before 8
    (tmp_path / "scan9_63.s1p").unlink()
    with pytest.raises(MeasurementError, match="no file with the index 9 between 8 and 10"):
        list_folder(tmp_path, line, base=tmp_path)


def test_a_list_tells_files_and_transmitters_in_its_own_order(folder: Path) -> None:
    (folder / "list.csv").write_text(
        "file,x,y,transmit_x\nx+1.0mm.s1p,1,2,31\nx-0.5mm.s1p,-0.5,2,29.5\n"
    )
    listed = list_folder(folder, table(csv="list.csv", origin=[0.0, 2.0, 0.0]), base=folder)
    np.testing.assert_array_equal(listed.positions, [[1e-3, 0, 0], [-0.5e-3, 0, 0]])
    assert listed.transmit_positions is not None
    np.testing.assert_array_equal(listed.transmit_positions[:, 0], [31e-3, 29.5e-3])
    assert listed.ignored == ("x+0.0mm.s1p", "x+0.5mm.s1p")


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("file,x\nx+1.0mm.s1p,\n", "line 2: x = ''; the position is missing"),
        ("file,x\nx+1.0mm.s1p\n", "line 2: x = None; the position is missing"),
        ("file,x\nx+1.0mm.s1p,nan\n", "line 2: x = 'nan'; the position is missing"),
        ("file,x\nx9mm.s1p,9\n", "line 2: no file 'x9mm.s1p'"),
        ("file,x\n../../secret.s1p,9\n", "line 2: file = .* must be a file in"),
        ("file,x\n/etc/hosts,9\n", "line 2: file = .* must be a file in"),
        ("name,x\nx+1.0mm.s1p,1\n", "needs a header line with file, x, y, z"),
        ("file,x\n", "0 rows"),
        ("file,x\nx+1.0mm.s1p,1\nx-0.5mm.s1p,1\n", "have the same position"),
    ],
)
def test_a_list_with_a_hole_is_refused(folder: Path, rows: str, message: str) -> None:
    (folder / "list.csv").write_text(rows)
    with pytest.raises(MeasurementError, match=message):
        list_folder(folder, table(csv="list.csv"), base=folder)


def test_missing_folders_lists_and_matches_are_told(folder: Path) -> None:
    with pytest.raises(MeasurementError, match="no such folder"):
        list_folder(folder / "none", table(files="x{x}mm.s1p"), base=folder)
    with pytest.raises(MeasurementError, match=r"none.csv: no such file"):
        list_folder(folder, table(csv="none.csv"), base=folder)
    with pytest.raises(MeasurementError, match=r"none of its 4 Touchstone files .*the first is"):
        list_folder(folder, table(files="y{y}mm.s1p"), base=folder)
    with pytest.raises(MeasurementError, match=r"needs positions\.files"):
        list_folder(folder, table(x=0.0), base=folder)


def test_two_files_at_one_position_are_refused(folder: Path) -> None:
    (folder / "x+1.00mm.s1p").write_text(text())
    with pytest.raises(MeasurementError, match=r"x\+1.00mm.s1p, x\+1.0mm.s1p have the same"):
        list_folder(folder, table(files="x{x}mm.s1p"), base=folder)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (text()[:-30], "not a whole Touchstone file"),  # cut within a row
        ("\n".join(text().splitlines()[:-1]) + "\n", "truncated"),  # cut between two rows
        (text()[:-4], "its last line has no end"),  # cut within the last number
        ("! nothing\n# Hz S RI R 50\n", "there is no line of data"),
        ("", "there is no line of data"),
        ("hello, I am no sweep\n", "not a whole Touchstone file"),
        (text().replace("Hz S RI", "Hz Z RI"), "holds Z-parameters; export S-parameters"),
        (text().replace("Hz S RI", "lightyears S RI"), "illegal frequency_unit"),
        (text() + "222e9 nan 0.0\n", r"point 5 \(2.22e\+11 Hz\) holds NaN"),
        (text() + "222e9 0.1 0.2\n", r"6 frequencies, but x-0.5mm.s1p has 5"),
        (text().replace("220250000000.0", "220250001000.0"), "frequency 1 is 220250001000 Hz, but"),
        (text(ports=2), "not a whole Touchstone file"),  # two-port data in a one-port's file
        ("\x00\x01\x02", "not a text file"),
        ("[Version] 2.0\n[Number of Ports] 1000000000\n", "not a Touchstone file of 1…99 ports"),
        (
            "[Version] 2.0\n# Hz S RI R 50\n[Number of Ports] 1\n[Reference]\n",
            "not a whole Touchstone file",
        ),
        (
            "[Version] 2.0\n# Hz S RI R 50\n[Number of Ports] 1\n[Number of Frequencies] 3\n"
            "[Network Data]\n220e9 0.1 0.2\n",
            "it announces 3 frequencies and holds 1",
        ),
    ],
)
def test_a_damaged_file_is_named_with_what_is_wrong(
    folder: Path, content: str, message: str
) -> None:
    damaged = folder / "x+0.5mm.s1p"
    damaged.write_text(content)
    with pytest.raises(MeasurementError, match=message) as refusal:
        scan(folder)
    assert "x+0.5mm.s1p" in str(refusal.value)


def test_a_sweep_that_runs_backwards_is_not_taken_for_noise_data(tmp_path: Path) -> None:
    falling = touchstone_text(FREQUENCY[::-1], sweep(0), ports=2, comment="downwards")
    (tmp_path / "down.s2p").write_text(falling)
    with pytest.raises(MeasurementError, match="the frequency falls"):
        read_touchstone(tmp_path / "down.s2p")


class Dangerous:
    """What runs code when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, ...]:
        return (Path.touch, (self.mark,))


@pytest.mark.parametrize("protocol", [0, 5])
def test_a_pickle_under_a_touchstone_name_is_never_loaded(tmp_path: Path, protocol: int) -> None:
    mark = tmp_path / "it_ran"
    (tmp_path / "x1.s1p").write_bytes(pickle.dumps(Dangerous(mark), protocol))
    with pytest.raises(MeasurementError):
        read_touchstone(tmp_path / "x1.s1p")
    assert not mark.exists()
    pickle.loads(pickle.dumps(Dangerous(mark)))  # it would have
    assert mark.exists()


def test_numbers_survive_the_file_to_the_last_bit_in_the_place_of_s21(tmp_path: Path) -> None:
    (tmp_path / "one.s2p").write_text(text(7, ports=2))
    read = read_touchstone(tmp_path / "one.s2p")
    np.testing.assert_array_equal(read.frequencies, FREQUENCY)
    np.testing.assert_array_equal(read.samples[:, 1, 0], sweep(7))
    assert not read.samples[:, 0, 0].any()


def test_decibels_and_gigahertz_are_as_scikit_rf_understands_them(tmp_path: Path) -> None:
    (tmp_path / "db.s1p").write_text("# GHz S DB R 50\n220 -20 90\n221 -40 180\n")
    read = read_touchstone(tmp_path / "db.s1p")
    np.testing.assert_array_equal(read.frequencies, [220e9, 221e9])
    np.testing.assert_allclose(read.samples[:, 0, 0], [0.1j, -0.01], atol=1e-16)


def test_a_parameter_that_the_files_lack_is_told(folder: Path) -> None:
    mapping = SweepMapping.model_validate(
        {
            "positions": {"files": "x{x}mm.s1p", "unit": "mm"},
            "echo": {"parameter": "S21"},
        }
    )
    assert mapping.echo is not None
    reader = FolderReader(folder, mapping, folder)
    with pytest.raises(MeasurementError, match="'S21', but the file has 1 port;"):
        reader.signal("echo", mapping.echo)


def test_one_file_can_be_the_background_and_the_response_of_all_positions(folder: Path) -> None:
    (folder / "empty.s2p").write_text(text(9, ports=2))
    mapping = SweepMapping.model_validate(
        {
            "positions": {"files": "x{x}mm.s1p", "unit": "mm"},
            "echo": {
                "parameter": "S11",
                "background": {"file": "empty.s2p", "parameter": "S21"},
                "response": {"file": "empty.s2p", "parameter": "S12"},
            },
        }
    )
    from mmslam.formats.import_measured import import_measured

    imported = import_measured(folder, mapping, base=folder)
    assert imported.measurement.echo is not None
    expected = (np.stack([sweep(number) for number in range(4)]) - sweep(9)) / sweep(9)
    # A product by the cable's phase of zero rounds nothing.
    np.testing.assert_allclose(imported.measurement.echo.samples, expected, rtol=1e-15)
    assert "1 Touchstone files do not belong" in imported.notes[0]
