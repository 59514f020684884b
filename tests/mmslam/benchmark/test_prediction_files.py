"""Files of predictions that are wrong say where, and what to do."""

import importlib.util
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from estimator.measurement.model import MeasurementError
from mmslam.benchmark import find_mirrors, locate_user, predict_channel
from mmslam.benchmark.prediction_table import BYTES_OF_FRAME, LONGEST_HEADER, SPARE
from mmslam.benchmark.recipe import load_recipe


def written(folder: Path, text: str, name: str = "it.csv") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("sample,x_m\n0,1", "no column y_m; give sample, x_m, y_m"),
        ("sample,x_mm,y_mm\n0,1,1", "x_mm is another unit: give metres as x_m"),
        ("sample,x_m,y_m,z_m\n0,1,1,1", "unknown column z_m"),
        ("sample,x_m,y_m\n0,1,1\n2,1,1", r"1 of 3 samples are missing \(1\)"),
        ("sample,x_m,y_m\n0,1,1\n1,1,1\n1,1,1", "row 3: sample 1 stands twice"),
        ("sample,x_m,y_m\n0,1,1\n1,1,\n2,1,1", "row 2: y_m = nan is no finite number"),
        ("sample,x_m,y_m\n0,1,1\n1,1,inf\n2,1,1", "y_m = inf is no finite number"),
        ("sample,x_m,y_m\n0,900,800\n1,1,1\n2,1,1", "are these millimetres"),
        ("sample,x_m,y_m\n0,1,1\n1,a,1\n2,1,1", "column x_m, row 2: 'a' is no number"),
        ("sample,x_m,y_m\n0,1,1\n1,1,1\n3,1,1", "is none of the 3 samples, 0 to 2"),
        ("sample,x_m,y_m\n0.5,1,1\n1,1,1\n2,1,1", "sample = 0.5 is no whole number"),
        ("sample,x_m,y_m\n,1,1\n1,1,1\n2,1,1", "sample = nan is missing or NaN"),
        ("", "not a CSV file with a header"),
    ],
)
def test_wrong_files_of_positions_say_row_and_remedy(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(MeasurementError, match=told):
        locate_user.read(written(tmp_path, text), 3)


def test_wrong_files_of_mirrors_say_row_and_remedy(tmp_path: Path) -> None:
    head = "sample,x1_m,y1_m,x2_m,y2_m\n"
    with pytest.raises(MeasurementError, match="from a point to itself"):
        find_mirrors.read(written(tmp_path, head + "1,0,1,0,1"), 3)
    with pytest.raises(MeasurementError, match="is none of the 3 samples"):
        find_mirrors.read(written(tmp_path, head + "3,0,1,0,2"), 3)
    # None at all is an answer, and so are two in one sample.
    assert [len(x) for x in find_mirrors.read(written(tmp_path, head), 2)] == [0, 0]
    two = written(tmp_path, head + "1,0,1,0,2\n1,0,1,1,1")
    assert [len(x) for x in find_mirrors.read(two, 2)] == [0, 2]


def channel_rows(value: str = "1e-4") -> list[str]:
    rows = np.linspace(0, 95, 16).round().astype(int)
    columns = np.linspace(0, 200, 32).round().astype(int)
    return [f"0,{row},{column},{value},0.0" for row in rows for column in columns]


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        (channel_rows()[:-1], "511 rows, but 1 samples of 16 elements and 32"),
        ([*channel_rows(), "0,1,0,0,0"], "element 1 is not asked for"),
        ([*channel_rows(), channel_rows()[0]], "sample 0, element 0, frequency 0 stands twice"),
        (channel_rows("-70.0"), "are these decibels"),
        ([*channel_rows()[:-1], "0,95,200,nan,0"], "element 95, frequency 200: re or im"),
    ],
)
def test_wrong_files_of_channels_say_what_is_missing(
    tmp_path: Path, rows: list[str], told: str
) -> None:
    file = written(tmp_path, "\n".join(["sample,element,frequency,re,im", *rows]))
    with pytest.raises(MeasurementError, match=told):
        predict_channel.read(file, 1, load_recipe("channel"), (96, 201))


def test_parquet_needs_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "it.parquet"
    with pytest.raises(MeasurementError, match="no such file"):
        locate_user.read(file, 1)
    written(tmp_path, "no Parquet", file.name)
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name == "pyarrow" else find(name, *a)
    )
    with pytest.raises(MeasurementError, match=r"install `mmslam\[parquet\]`"):
        locate_user.read(file, 1)
    with pytest.raises(MeasurementError, match=r"are a \.csv or a \.parquet file"):
        locate_user.read(written(tmp_path, "", "it.txt"), 1)


def test_parquet_is_read_as_csv_is(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    import pandas as pd

    table = pd.DataFrame({"sample": [1, 0], "x_m": [0.5, 0.25], "y_m": [1.0, 2.0]})
    table.to_parquet(tmp_path / "it.parquet")
    found = locate_user.read(tmp_path / "it.parquet", 2)
    np.testing.assert_array_equal(found, [[0.25, 2.0], [0.5, 1.0]])
    with pytest.raises(MeasurementError, match="not a Parquet file"):
        locate_user.read(written(tmp_path, "nothing", "other.parquet"), 2)


HEAD = "sample,x_m,y_m\n"


def test_a_file_larger_than_its_rows_can_be_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "it.csv"
    with file.open("wb") as stream:  # a file with a hole: 2 GiB that take no place
        stream.write(HEAD.encode())
        stream.truncate(2**31)
    tracemalloc.start()
    with pytest.raises(MeasurementError, match=rf"{2**31} bytes are more than \d+, which 6 rows"):
        locate_user.read(file, 3)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < BYTES_OF_FRAME
    file.rename(tmp_path / "it.parquet")
    pytest.importorskip("pyarrow")
    with pytest.raises(MeasurementError, match=rf"{2**31} bytes are more than \d+, which 6 rows"):
        locate_user.read(tmp_path / "it.parquet", 3)


def test_more_rows_than_a_part_has_are_refused_by_their_number(tmp_path: Path) -> None:
    short = HEAD + "0,1,1\n" * (SPARE * 3)
    with pytest.raises(MeasurementError, match="row 2: sample 0 stands twice"):
        locate_user.read(written(tmp_path, short), 3)
    with pytest.raises(MeasurementError, match=r"more than 6 rows, but 3 are the most"):
        locate_user.read(written(tmp_path, short + "0,1,1\n"), 3)
    head, row = "sample,x1_m,y1_m,x2_m,y2_m\n", "0,0,1,0,2\n"
    assert len(find_mirrors.read(written(tmp_path, head + 100 * row), 1)[0]) == 100
    with pytest.raises(MeasurementError, match=r"more than 200 rows, but 100 are the most"):
        find_mirrors.read(written(tmp_path, head + 201 * row), 1)
    wide = "sample," * LONGEST_HEADER
    with pytest.raises(MeasurementError, match=f"first line has more than {LONGEST_HEADER} bytes"):
        locate_user.read(written(tmp_path, wide), 3)


def test_the_longest_numbers_fit_into_a_file_of_a_whole_part(tmp_path: Path) -> None:
    # Beyond the frame's bytes: 24 signs for a number, quoted and with blanks.
    rows = "".join(f' "{n}" , "-1.2345678901234567e-100" , "-1.2345678901234567e-100" \n'
                   for n in range(30000))  # fmt: skip
    file = written(tmp_path, HEAD + rows.replace('" ', '"').replace(' "', '"'))
    assert file.stat().st_size > BYTES_OF_FRAME
    assert np.abs(locate_user.read(file, 30000)).max() < 1e-99


def test_what_a_file_says_is_shown_plainly_and_cut(tmp_path: Path) -> None:
    texts = {
        "name": f"sample,x_m,y_m,\x1b]0;owned\x07{'a' * 3000}\n0,1,1,1",
        "names": HEAD.strip() + "".join(f",c{n}" for n in range(300)) + "\n",
        "value": f"{HEAD}0,1,\x1b[2J{'b' * 100000}\n",
        "parser": f'{HEAD}0,1,1\n0,1,1,"\x1b[2J",3,4\n',
    }
    for name, text in texts.items():
        with pytest.raises(MeasurementError) as caught:
            locate_user.read(written(tmp_path, text, f"{name}.csv"), 3)
        told = str(caught.value)
        assert told.isprintable(), name
        assert len(told) < 600 + len(str(tmp_path)), name
    with pytest.raises(MeasurementError, match="unknown column c0, c1, c2, c3, c4 and 295 more"):
        locate_user.read(tmp_path / "names.csv", 3)
    with pytest.raises(MeasurementError, match="column y_m stands twice"):
        locate_user.read(written(tmp_path, "sample,x_m,y_m,y_m \n0,1,1,1"), 1)


def test_a_parquet_footer_is_read_before_its_rows(tmp_path: Path) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    file = tmp_path / "it.parquet"

    def write(count: int, **more: object) -> None:
        columns = {"sample": np.arange(count) % 3, "x_m": np.ones(count), "y_m": np.ones(count)}
        parquet.write_table(arrow.table({**columns, **more}), file)

    write(3)
    np.testing.assert_array_equal(locate_user.read(file, 3), np.ones((3, 2)))
    write(2_000_000)  # equal numbers pack well: smaller than the largest file
    assert file.stat().st_size < BYTES_OF_FRAME
    with pytest.raises(MeasurementError, match="2000000 rows, but 3 are the most"):
        locate_user.read(file, 3)
    write(3, found=[[1] * 100_000] * 3)
    with pytest.raises(MeasurementError, match="300000 rows, but 3 are the most"):
        locate_user.read(file, 3)
    write(3, found=["a" * 2**22] * 3)
    with pytest.raises(MeasurementError, match=r"unpack to \d+ bytes, more than"):
        locate_user.read(file, 3)
    written(tmp_path, "PAR1 no Parquet \x1b[2J", file.name)
    with pytest.raises(MeasurementError, match="not a Parquet file"):
        locate_user.read(file, 3)
