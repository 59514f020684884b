"""Files of predictions that are wrong say where, and what to do."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from estimator.measurement.model import MeasurementError
from mmslam.benchmark import find_mirrors, locate_user, predict_channel
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
