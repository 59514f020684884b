import json

# Over 400 lines: one store is damaged in every way.
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from estimator.measurement import store as store_module
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.measurement.store import (
    is_store,
    measurement_to_dataset,
    read_measurement,
    write_measurement,
)

RNG = np.random.default_rng(11)
POSITIONS = np.stack([np.linspace(-0.06, 0.06, 5), np.zeros(5), np.full(5, 1.2)], axis=-1)
ELEMENTS = POSITIONS[1:] + np.array([0.0, 0.01, 0.0])
FREQUENCIES = np.linspace(220e9, 295e9, 7)


def noise(*shape: int) -> np.ndarray:
    return RNG.standard_normal(shape) + 1j * RNG.standard_normal(shape)


def uplink(user: str, **changes: Any) -> Uplink:
    values = {"samples": noise(4, 7), "positions": ELEMENTS, "frequencies": FREQUENCIES, **changes}
    return Uplink(user=user, **values)


@pytest.fixture
def measurement() -> Measurement:
    return Measurement(
        echo=Echo(samples=noise(5, 7), positions=POSITIONS, frequencies=FREQUENCIES),
        uplinks=(uplink("ann"), uplink("Björn 2")),
        waves="cylindrical",
        boresight=np.array([0.6, 0.8, 0.0]),
        clock_offset=-1.5e-9,
        scenario="hall",
        seed=42,
    )


@pytest.fixture
def truth() -> xr.Dataset:
    labels = np.dtypes.StringDType()
    return xr.Dataset(
        {"user_position": (("user", "axis"), np.array([[1.0, 0.8, 0.0]]))},
        {"user": ("user", np.array(["ann"], dtype=labels))},
    )


def assert_same(one: Measurement, other: Measurement) -> None:
    assert (one.echo is None) == (other.echo is None)
    pairs: list[tuple[Echo | Uplink, Echo | Uplink]] = list(
        zip(one.uplinks, other.uplinks, strict=True)
    )
    if one.echo is not None and other.echo is not None:
        pairs.append((one.echo, other.echo))
    for a, b in pairs:
        for name in ("samples", "positions", "frequencies"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert [a.user for a in one.uplinks] == [b.user for b in other.uplinks]
    np.testing.assert_array_equal(one.boresight, other.boresight)
    for name in ("waves", "clock_offset", "scenario", "seed"):
        assert getattr(one, name) == getattr(other, name)


def write(path: Path, dataset: xr.Dataset) -> Path:
    """Write a dataset as somebody else might have."""
    dataset.to_zarr(path, zarr_format=3, consolidated=False)
    return path


def everything_in(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


# Round trips


def test_what_is_written_is_read_back_bit_for_bit(measurement: Measurement, tmp_path: Path) -> None:
    write_measurement(tmp_path / "a.zarr", measurement)
    assert is_store(tmp_path / "a.zarr")
    assert_same(read_measurement(tmp_path / "a.zarr"), measurement)


@pytest.mark.parametrize("left_out", ["echo", "uplinks"])
def test_either_part_may_be_missing(
    left_out: str, measurement: Measurement, tmp_path: Path
) -> None:
    without: dict[str, Any] = {"echo": None} if left_out == "echo" else {"uplinks": ()}
    part = replace(measurement, **without)
    write_measurement(tmp_path / "a.zarr", part)
    assert_same(read_measurement(tmp_path / "a.zarr"), part)


def test_what_is_unknown_stays_unknown(measurement: Measurement, tmp_path: Path) -> None:
    plain = Measurement(echo=measurement.echo, uplinks=())
    write_measurement(tmp_path / "a.zarr", plain)
    assert_same(read_measurement(tmp_path / "a.zarr"), plain)


def test_samples_that_are_all_zero_but_one_are_kept(
    measurement: Measurement, tmp_path: Path
) -> None:
    samples = np.zeros((5, 7), dtype=np.complex128)
    samples[4, 6] = 1.0
    sparse = Measurement(
        echo=Echo(samples=samples, positions=POSITIONS, frequencies=FREQUENCIES), uplinks=()
    )
    write_measurement(tmp_path / "a.zarr", sparse)
    assert_same(read_measurement(tmp_path / "a.zarr"), sparse)


def test_missing_folders_on_the_way_are_made(measurement: Measurement, tmp_path: Path) -> None:
    write_measurement(tmp_path / "b" / "c" / "a.zarr", measurement)
    assert everything_in(tmp_path / "b" / "c") >= {"a.zarr", "a.zarr/zarr.json"}


def test_the_store_is_plain_zarr_and_holds_no_pickle(
    measurement: Measurement, truth: xr.Dataset, tmp_path: Path
) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement, truth=truth)
    for file in store.rglob("zarr.json"):
        assert "pickle" not in file.read_text()
        assert json.loads(file.read_text())["zarr_format"] == 3
    for name in ("echo", "uplink", "frequency", "aperture_position", "element_position"):
        metadata = json.loads((store / name / "zarr.json").read_text())
        fill = metadata["fill_value"]
        # What a missing chunk reads as must not pass as data.
        assert fill == "NaN" or fill == ["NaN", "NaN"], name


# What others write


def test_single_precision_is_read_as_double(measurement: Measurement, tmp_path: Path) -> None:
    dataset = measurement_to_dataset(measurement)
    for name in ("echo", "uplink"):
        dataset[name] = dataset[name].astype(np.complex64)
    found = read_measurement(write(tmp_path / "a.zarr", dataset))
    assert found.echo is not None
    assert measurement.echo is not None
    assert found.echo.samples.dtype == np.complex128
    # Half a unit in the last place of float32, of each component.
    np.testing.assert_allclose(found.echo.samples, measurement.echo.samples, rtol=1e-7)


def test_dimensions_in_another_order_are_read_alike(
    measurement: Measurement, tmp_path: Path
) -> None:
    dataset = measurement_to_dataset(measurement).transpose()
    assert_same(read_measurement(write(tmp_path / "a.zarr", dataset)), measurement)


def test_a_store_without_attributes_and_labels_has_the_defaults(
    measurement: Measurement, tmp_path: Path
) -> None:
    dataset = measurement_to_dataset(measurement).drop_vars(["user", "axis"])
    dataset.attrs = {}
    found = read_measurement(write(tmp_path / "a.zarr", dataset))
    assert [one.user for one in found.uplinks] == ["0", "1"]
    assert (found.waves, found.clock_offset, found.seed) == ("spherical", None, None)
    np.testing.assert_array_equal(found.boresight, [0, 1, 0])


def test_one_sample_of_a_dataset_is_chosen(measurement: Measurement, tmp_path: Path) -> None:
    one = measurement_to_dataset(measurement)
    louder = measurement_to_dataset(measurement)
    louder["echo"] = 2 * louder["echo"]
    names = ["echo", "uplink"]
    both = xr.concat([one[names], louder[names]], dim="sample").merge(one.drop_vars(names))
    both.attrs = one.attrs
    path = write(tmp_path / "a.zarr", both)
    assert measurement.echo is not None
    for sample in (0, 1):
        found = read_measurement(path, sample=sample)
        assert found.echo is not None
        np.testing.assert_array_equal(found.echo.samples, (1 + sample) * measurement.echo.samples)
    with pytest.raises(MeasurementError, match=r"holds 2 samples; choose one, 0…1"):
        read_measurement(path)
    for sample in (2, -1):
        with pytest.raises(MeasurementError, match=rf"sample {sample} of 2; it must be 0…1"):
            read_measurement(path, sample=sample)


def test_a_measurement_has_no_samples_to_choose_from(
    measurement: Measurement, tmp_path: Path
) -> None:
    write_measurement(tmp_path / "a.zarr", measurement)
    with pytest.raises(MeasurementError, match="no 'sample' dimension; leave --sample out"):
        read_measurement(tmp_path / "a.zarr", sample=0)


# What cannot be used


@pytest.mark.parametrize(
    ("name", "chunk"), [("echo", "c/0/0"), ("uplink", "c/0/0/0"), ("frequency", "c/0")]
)
def test_a_missing_chunk_is_not_silent_zeros(
    name: str, chunk: str, measurement: Measurement, tmp_path: Path
) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement)
    (store / name / chunk).unlink()
    with pytest.raises(MeasurementError, match="NaN or infinite"):
        read_measurement(store)


@pytest.mark.parametrize("name", ["echo", "frequency", "user"])
def test_a_truncated_chunk_is_refused(name: str, measurement: Measurement, tmp_path: Path) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement)
    (chunk,) = [path for path in (store / name / "c").rglob("*") if path.is_file()]
    chunk.write_bytes(chunk.read_bytes()[: chunk.stat().st_size // 2])
    with pytest.raises(MeasurementError, match=r"a\.zarr: the store cannot be read .*truncated"):
        read_measurement(store)


@pytest.mark.parametrize("name", ["", "echo"])
@pytest.mark.parametrize("text", ["", "{", "[]", '{"zarr_format": 2}'])
def test_damaged_metadata_is_refused(
    name: str, text: str, measurement: Measurement, tmp_path: Path
) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement)
    (store / name / "zarr.json").write_text(text)
    with pytest.raises(MeasurementError, match=r"a\.zarr"):
        read_measurement(store)


def test_what_is_not_there_or_not_a_store_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match=r"none\.zarr: no such file or folder"):
        read_measurement(tmp_path / "none.zarr")
    (tmp_path / "photos").mkdir()
    (tmp_path / "file.zarr").write_text("x")
    for name in ("photos", "file.zarr"):
        with pytest.raises(MeasurementError, match=r"not a Zarr v3 group .*`mmslam import`"):
            read_measurement(tmp_path / name)


def test_a_foreign_or_empty_group_is_refused_with_what_it_holds(tmp_path: Path) -> None:
    foreign = xr.Dataset({"temperature": ("time", np.zeros(3))})
    with pytest.raises(MeasurementError, match=r"neither 'echo' nor 'uplink'.*found: temperature"):
        read_measurement(write(tmp_path / "a.zarr", foreign))
    with pytest.raises(MeasurementError, match="without arrays"):
        read_measurement(write(tmp_path / "b.zarr", xr.Dataset()))


@pytest.mark.parametrize("name", ["frequency", "aperture_position", "element_position"])
def test_a_missing_variable_is_named(name: str, measurement: Measurement, tmp_path: Path) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement)
    shutil.rmtree(store / name)
    with pytest.raises(MeasurementError, match=f"variable '{name}' is missing"):
        read_measurement(store)


def dataset_with(measurement: Measurement, **changes: Any) -> xr.Dataset:
    dataset = measurement_to_dataset(measurement)
    for name, variable in changes.items():
        dataset = dataset.drop_vars(name).assign({name: variable})
    return dataset


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        pytest.param(
            {"echo": (("place", "frequency"), noise(5, 7))},
            r"'echo' has dimensions \('place', 'frequency'\); they must be \('position', 'freq",
            id="dimensions",
        ),
        pytest.param(
            {"echo": (("position", "frequency"), np.full((5, 7), "x"))},
            "'echo' has type .*it must be complex",
            id="text",
            marks=pytest.mark.filterwarnings("ignore:The data type"),
        ),
        pytest.param(
            {"aperture_position": (("position", "axis"), noise(5, 3))},
            "'aperture_position' has type complex128; it must be float",
            id="complex",
        ),
        pytest.param(
            {"echo": (("position", "frequency"), np.full((5, 7), np.nan + 0j))},
            "35 of 35 samples are NaN",
            id="nan",
        ),
    ],
)
def test_variables_of_another_kind_are_refused(
    changes: dict[str, Any], message: str, measurement: Measurement, tmp_path: Path
) -> None:
    path = write(tmp_path / "a.zarr", dataset_with(measurement, **changes))
    with pytest.raises(MeasurementError, match=message):
        read_measurement(path)


def test_positions_in_a_plane_lack_a_coordinate(measurement: Measurement, tmp_path: Path) -> None:
    dataset = measurement_to_dataset(measurement).isel(axis=[0, 1])
    with pytest.raises(MeasurementError, match="has 2 coordinates; it needs x, y and z"):
        read_measurement(write(tmp_path / "a.zarr", dataset))


@pytest.mark.parametrize(
    ("attribute", "value", "message"),
    [
        ("mmslam_format", 2, "format 2, this program reads 1"),
        ("mmslam_format", "new", "format 'new'"),
        ("waves", "flat", "waves = 'flat'; it must be spherical or cylindrical"),
        ("boresight", [0.0, 2.0, 0.0], "it must be a unit vector"),
        ("boresight", [0.0, 1.0], "it must be a unit vector"),
        ("boresight", "up", "boresight = 'up'"),
        ("clock_offset_s", "late", "clock_offset_s = 'late'; it must be a finite number"),
        ("clock_offset_s", True, "clock_offset_s = True"),
        ("seed", "x", "seed = 'x'"),
    ],
)
def test_attributes_that_mean_nothing_are_refused(
    attribute: str, value: object, message: str, measurement: Measurement, tmp_path: Path
) -> None:
    dataset = measurement_to_dataset(measurement)
    dataset.attrs[attribute] = value
    with pytest.raises(MeasurementError, match=message):
        read_measurement(write(tmp_path / "a.zarr", dataset))


# The truth


def test_the_truth_lies_beside_and_is_not_read(
    measurement: Measurement, truth: xr.Dataset, tmp_path: Path
) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement, truth=truth)
    with xr.open_zarr(store, group="truth", consolidated=False) as kept:
        np.testing.assert_array_equal(kept["user_position"].values, [[1.0, 0.8, 0.0]])
    chunks = [path for path in (store / "truth").rglob("c/**/*") if path.is_file()]
    assert chunks
    for chunk in chunks:
        chunk.write_bytes(b"nonsense")
    assert_same(read_measurement(store), measurement)


def test_an_overwritten_store_holds_the_new_measurement_and_the_new_truth(
    measurement: Measurement, truth: xr.Dataset, tmp_path: Path
) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement, truth=2 * truth)
    second = replace(measurement, echo=None, seed=43)
    write_measurement(store, second, truth=truth)
    assert_same(read_measurement(store), second)
    with xr.open_zarr(store, group="truth", consolidated=False) as kept:
        np.testing.assert_array_equal(kept["user_position"].values, [[1.0, 0.8, 0.0]])
    assert not (store / "echo").exists()


# Writes that fail


@pytest.mark.parametrize("kind", ["folder", "file"])
def test_nothing_but_a_store_is_replaced(
    kind: str, measurement: Measurement, tmp_path: Path
) -> None:
    path = tmp_path / "thesis"
    if kind == "folder":
        path.mkdir()
        (path / "chapter.txt").write_text("x")
    else:
        path.write_text("x")
    before = everything_in(tmp_path)
    with pytest.raises(MeasurementError, match="thesis exists and is not a measurement store"):
        write_measurement(path, measurement)
    assert everything_in(tmp_path) == before


@pytest.mark.parametrize("failing", ["root", "truth"])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_write_that_fails_leaves_what_was_there_and_nothing_else(
    failing: str,
    error: BaseException,
    measurement: Measurement,
    truth: xr.Dataset,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement, truth=truth)
    before = everything_in(tmp_path)
    really_write: Any = xr.Dataset.to_zarr

    def full(dataset: xr.Dataset, *args: Any, group: str | None = None, **options: Any) -> object:
        if (group or "root") == failing:
            raise error
        return really_write(dataset, *args, group=group, **options)

    monkeypatch.setattr(xr.Dataset, "to_zarr", full)
    with pytest.raises(type(error)):
        write_measurement(store, replace(measurement, seed=1), truth=truth)
    with pytest.raises(type(error)):
        write_measurement(tmp_path / "new.zarr", measurement, truth=truth)
    monkeypatch.undo()
    assert everything_in(tmp_path) == before
    assert_same(read_measurement(store), measurement)


@pytest.mark.parametrize("in_one_step", [True, False])
def test_the_old_store_survives_if_the_new_one_cannot_take_its_place(
    measurement: Measurement, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_one_step: bool
) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement)
    really_rename = Path.rename

    def refuse_the_new_one(path: Path, target: Path) -> Path:
        if path.name == "new":
            raise OSError(13, "Permission denied")
        return really_rename(path, target)

    def refuse(*_: object) -> bool:
        raise OSError(13, "Permission denied")

    if in_one_step:
        monkeypatch.setattr(store_module, "exchange", refuse)
    else:  # as where a system exchanges no names
        monkeypatch.setattr(store_module, "exchange", lambda one, other: False)
        monkeypatch.setattr(Path, "rename", refuse_the_new_one)
    with pytest.raises(OSError, match="Permission denied"):
        write_measurement(store, replace(measurement, seed=1))
    monkeypatch.undo()
    assert_same(read_measurement(store), measurement)


def test_folders_made_for_a_store_that_fails_are_taken_away_again(
    measurement: Measurement, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "there").mkdir()

    def refused(*args: object, **options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_zarr", refused)
    with pytest.raises(OSError, match="No space left"):
        write_measurement(tmp_path / "there/not/yet/a.zarr", measurement)
    assert everything_in(tmp_path) == {"there"}
    monkeypatch.undo()
    write_measurement(tmp_path / "there/not/yet/a.zarr", measurement)
    assert_same(read_measurement(tmp_path / "there/not/yet/a.zarr"), measurement)


@pytest.mark.parametrize("damage", ["metadata", "variable", "closed"])
def test_a_measurement_is_read_whatever_has_become_of_its_truth(
    damage: str, measurement: Measurement, truth: xr.Dataset, tmp_path: Path
) -> None:
    store = tmp_path / "a.zarr"
    write_measurement(store, measurement, truth=truth)
    match damage:
        case "metadata":
            (store / "truth/zarr.json").write_text("{")
        case "variable":
            (store / "truth/user_position/zarr.json").write_text("[]")
        case "closed":
            shutil.rmtree(store / "truth")
            (store / "truth").symlink_to("truth")  # reading it fails for every user
    assert_same(read_measurement(store), measurement)


def test_a_folder_that_cannot_be_written_says_so(
    measurement: Measurement, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*args: object, **options: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "mkdtemp", refused)
    with pytest.raises(PermissionError):
        write_measurement(tmp_path / "a.zarr", measurement)
    assert everything_in(tmp_path) == set()


# What the layout cannot hold must not be lost on the way


def test_an_echo_of_separate_transmitters_is_not_stored_as_monostatic(
    measurement: Measurement, tmp_path: Path
) -> None:
    echo = Echo(
        samples=noise(5, 7),
        positions=POSITIONS,
        frequencies=FREQUENCIES,
        transmit_positions=POSITIONS + 0.1,
    )
    bistatic = replace(measurement, echo=echo)
    try:
        write_measurement(tmp_path / "a.zarr", bistatic)
    except MeasurementError:
        return  # refusing is fine as well
    found = read_measurement(tmp_path / "a.zarr").echo
    assert found is not None
    assert found.transmit_positions is not None


@pytest.mark.parametrize("name", ["positions", "frequencies"])
def test_uplinks_at_other_elements_or_frequencies_are_refused(
    name: str, measurement: Measurement
) -> None:
    other = {"positions": ELEMENTS + 0.01, "frequencies": FREQUENCIES + 1e9}[name]
    with pytest.raises(MeasurementError, match=f"different .*{name}"):
        replace(measurement, uplinks=(uplink("ann"), uplink("bob", **{name: other})))
