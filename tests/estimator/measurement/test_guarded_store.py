import gzip
import json
import os
from pathlib import Path

import numcodecs  # type: ignore[import-untyped]
import numpy as np
import pytest
import zarr

from estimator.measurement import guarded_store
from estimator.measurement.guarded_store import LARGEST_CHUNK, damage_told, opened_store
from estimator.measurement.model import Echo, Measurement, MeasurementError
from estimator.measurement.store import read_measurement, write_measurement


@pytest.fixture
def store(tmp_path: Path) -> Path:
    positions = np.stack([np.linspace(-0.01, 0.01, 5), np.zeros(5), np.zeros(5)], axis=-1)
    echo = Echo(
        samples=np.ones((5, 7), dtype=np.complex128),
        positions=positions,
        frequencies=np.linspace(220e9, 290e9, 7),
    )
    write_measurement(tmp_path / "a.zarr", Measurement(echo=echo, uplinks=()))
    return tmp_path / "a.zarr"


def test_a_link_out_of_a_store_is_not_followed(store: Path) -> None:
    secret = store.parent / "secret"
    secret.write_bytes(bytes(range(256)))
    chunk = store / "echo" / "c" / "0" / "0"
    chunk.unlink()
    chunk.symlink_to(secret)
    with pytest.raises(MeasurementError, match=r"echo/c/0/0 is a link out of the store"):
        read_measurement(store)


def test_a_link_to_a_whole_store_is_followed(store: Path) -> None:
    link = store.with_name("link.zarr")
    link.symlink_to(store)
    assert read_measurement(link).echo is not None


def test_a_chunk_that_unpacks_to_more_than_it_may_is_not_unpacked(store: Path) -> None:
    # 40 bytes that say they are 2^40: a frame of one segment with 8 bytes of content size.
    frame = b"\x28\xb5\x2f\xfd" + b"\xe0" + (2**40).to_bytes(8, "little") + bytes(27)
    (store / "echo" / "c" / "0" / "0").write_bytes(frame)
    with pytest.raises(MeasurementError, match=rf"unpacks to {2**40} bytes, more than"):
        read_measurement(store)


@pytest.mark.parametrize("members", [1, 3])
def test_what_gzip_unpacks_to_is_counted_not_kept(members: int) -> None:
    packed = gzip.compress(bytes(2**22)) * members
    whole = members * 2**22
    assert guarded_store._unpacks_to_more(packed, whole - 1)
    assert not guarded_store._unpacks_to_more(packed, whole)
    assert not guarded_store._unpacks_to_more(packed[:-20], whole)  # cut: its codec says so
    assert not guarded_store._unpacks_to_more(b"\x1f\x8b" + bytes(99), whole)


@pytest.mark.parametrize("length", [0, 100, 300, 70_000, 2**21])
def test_the_size_in_a_zstandard_frame_is_what_it_unpacks_to(length: int) -> None:
    packed = numcodecs.Zstd().encode(os.urandom(length))
    found = guarded_store._unpacked_size(packed[:18])
    assert found in (length, None)
    assert (found is not None) or length == 0 or len(packed) < 18


@pytest.mark.parametrize("shape", [[2**20, 2**20], [5, LARGEST_CHUNK]])
def test_chunks_larger_than_the_memory_are_refused(store: Path, shape: list[int]) -> None:
    path = store / "echo" / "zarr.json"
    metadata = json.loads(path.read_text())
    metadata["chunk_grid"]["configuration"]["chunk_shape"] = shape
    path.write_text(json.dumps(metadata))
    with pytest.raises(MeasurementError, match="write it in smaller chunks"):
        read_measurement(store)


def test_an_array_larger_than_the_memory_is_refused_before_it_is_read(store: Path) -> None:
    path = store / "echo" / "zarr.json"
    metadata = json.loads(path.read_text())
    metadata["shape"] = [5, 2**40]
    path.write_text(json.dumps(metadata))
    with pytest.raises(MeasurementError):
        read_measurement(store)


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("seed", 10**400, "seed = a whole number of more than 30 digits"),
        ("seed", 1.5, "seed = 1.5"),
        ("seed", True, "seed = True"),
        ("clock_offset_s", 10**400, "clock_offset_s = a whole number"),
        ("clock_offset_s", "x" * 10**5, r"clock_offset_s = 'x+… \(100002 characters\)"),
        ("waves", ["spherical"] * 10**4, r"waves = \['spherical'.*characters"),
        ("boresight", [10**400, 0, 0], "boresight = "),
        ("mmslam_format", "9" * 10**4, "format '9+… "),
    ],
)
def test_attributes_that_cannot_be_are_named_in_few_words(
    store: Path, key: str, value: object, told: str
) -> None:
    path = store / "zarr.json"
    metadata = json.loads(path.read_text())
    metadata["attributes"][key] = value
    path.write_text(json.dumps(metadata))
    with pytest.raises(MeasurementError, match=told) as refused:
        read_measurement(store)
    assert len(str(refused.value)) < 600


@pytest.mark.parametrize("seed", [2**63 - 1, -3, 7.0])
def test_a_seed_keeps_all_its_digits(store: Path, seed: float) -> None:
    path = store / "zarr.json"
    metadata = json.loads(path.read_text())
    metadata["attributes"]["seed"] = seed
    path.write_text(json.dumps(metadata))
    assert read_measurement(store).seed == seed


def test_what_zarr_says_of_damage_is_cut(store: Path) -> None:
    with pytest.raises(MeasurementError) as refused, damage_told(store):
        raise KeyError("x" * 200_000)
    assert len(str(refused.value)) < 500


def test_names_that_no_file_system_takes_are_refused() -> None:
    for name in ("x" * 5000, "a\0b"):
        with pytest.raises(MeasurementError):
            opened_store(Path(name))


def test_zarr_itself_reads_a_guarded_store(store: Path) -> None:
    group = zarr.open_group(opened_store(store), mode="r")
    echo = group["echo"]
    assert isinstance(echo, zarr.Array)
    np.testing.assert_array_equal(echo[...], np.ones((5, 7)))
