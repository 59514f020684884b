"""Datasets for learning: parts by room, normalisation, batches, workers, the card."""

import json
import pickle
import subprocess
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import yaml
import zarr
from typer.testing import CliRunner

import mmslam
from estimator.measurement.model import MeasurementError
from mmslam.cli import app
from mmslam.datasets import Dataset
from mmslam.learning.normalisation import ATTRIBUTE, Constants
from mmslam.learning.room_split import PARTS, split_by_room
from simulator.dataset import layout

CONFIG: dict[str, Any] = {
    "base": "point_scatterers",
    "count": 24,
    "seed": 5,
    "rooms": {"count": 8},
    "set": {"base_station.elements": 6, "radio.points": 5, "users.ann.position_m": [0.2, 0.5]},
    "vary": {
        "points.near.position_m": {"kind": "in_box", "low_m": [-0.1, 0.4], "high_m": [0.1, 0.5]},
        "users.ann.position_m": {"kind": "in_box", "low_m": [0.1, 0.3], "high_m": [0.3, 0.6]},
    },
}


def made(folder: Path, **changes: Any) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layout, "BLOCK_SAMPLES", 4)  # six files
        assert mmslam.make_dataset({**CONFIG, **changes}, folder / "it.zarr").failed == 0
    return folder / "it.zarr"


def attributes(store: Path) -> dict[str, Any]:
    return dict(zarr.open_group(store, mode="r").attrs.asdict())


def sweep(dataset: Dataset, sample: int) -> np.ndarray:
    echo = dataset[sample].echo
    assert echo is not None
    return echo.samples


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("learning"))


@pytest.fixture
def torch(monkeypatch: pytest.MonkeyPatch) -> Iterator[types.ModuleType]:
    """Stand in for PyTorch: the three names that are imported from it."""
    data = types.ModuleType("torch.utils.data")
    data.Dataset = type("Dataset", (), {})  # type: ignore[attr-defined]
    data.IterableDataset = type("IterableDataset", (), {})  # type: ignore[attr-defined]
    data.get_worker_info = lambda: None  # type: ignore[attr-defined]
    monkeypatch.delitem(sys.modules, "mmslam.learning.torch_dataset", raising=False)
    for name in ("torch", "torch.utils"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, "torch.utils.data", data)
    yield data
    sys.modules.pop("mmslam.learning.torch_dataset", None)


def test_no_room_is_in_two_parts_and_every_sample_is_in_one(store: Path) -> None:
    dataset = mmslam.open_dataset(store)
    parts = dataset.split()
    assert list(parts) == list(PARTS)
    rooms = [set(dataset.rooms[some].tolist()) for some in parts.values()]
    assert [len(some) for some in rooms] == [6, 1, 1]
    assert len(set.union(*rooms)) == 8
    assert sorted(np.concatenate(list(parts.values())).tolist()) == list(range(24))


def test_a_division_is_the_same_again_and_another_by_another_seed(store: Path) -> None:
    dataset = mmslam.open_dataset(store)
    one, again = dataset.split(seed=1), dataset.split(seed=1)
    assert all(np.array_equal(one[part], again[part]) for part in PARTS)
    tests = {tuple(dataset.split(seed=seed)["test"].tolist()) for seed in range(20)}
    assert len(tests) > 3  # of eight rooms


def test_the_order_of_samples_does_not_move_a_room_to_another_part() -> None:
    rooms = np.repeat(np.arange(30), 2)
    mixed = np.random.default_rng(0).permutation(rooms)
    one, other = split_by_room(rooms), split_by_room(mixed)
    for part in PARTS:
        assert set(rooms[one[part]]) == set(mixed[other[part]])


@pytest.mark.parametrize(
    ("rooms", "told"), [([3] * 9, "are in one room"), ([3, 4, 4], "are in 2 rooms")]
)
def test_too_few_rooms_are_refused_with_the_remedy(rooms: list[int], told: str) -> None:
    with pytest.raises(MeasurementError, match=rf"{told}.*\[rooms\] count"):
        split_by_room(np.array(rooms))


@pytest.mark.parametrize("shares", [(0.5, 0.5), (0.5, 0.4, 0.2), (1.0, 0.0, 0.0)])
def test_shares_that_are_none_are_refused(shares: tuple[float, ...]) -> None:
    with pytest.raises(MeasurementError, match="give three positive shares"):
        split_by_room(np.arange(9), shares=shares)


def test_samples_are_those_of_the_store(store: Path) -> None:
    dataset = mmslam.open_dataset(store)
    test = dataset.samples("test")
    plain = xr.open_zarr(store, consolidated=False).load()
    assert test[1]["sample"] == dataset.split()["test"][1]
    np.testing.assert_array_equal(test[1]["echo"], plain["echo"].values[test[1]["sample"]])
    batch = test.__getitems__([2, 0, 2])
    assert [one["sample"] for one in batch] == [test[i]["sample"] for i in (2, 0, 2)]
    np.testing.assert_array_equal(batch[0]["uplink"], test[2]["uplink"])
    with pytest.raises(IndexError):
        test[len(test)]
    with pytest.raises(MeasurementError, match="no variable 'truth/walls'"):
        dataset.samples(variables=("truth/walls",))
    with pytest.raises(MeasurementError, match="give one of train, validation, test"):
        dataset.samples("dev")


def test_normalised_signals_have_a_mean_power_of_one_over_the_training_part(store: Path) -> None:
    dataset = mmslam.open_dataset(store)
    normalised = dataset.samples("train", normalise=("echo", "truth/user_position"))
    power = np.mean([np.abs(one["echo"]) ** 2 for one in normalised])
    assert power == pytest.approx(1.0, rel=1e-6)  # single precision: 6e-8 for each sample
    places = np.stack([one["truth/user_position"][0, :2] for one in normalised])
    plain = np.stack([one["truth/user_position"][0, :2] for one in dataset.samples("train")])
    constants = dataset.normalisation()["truth/user_position"]
    np.testing.assert_allclose(constants.restored(places), plain, rtol=1e-12)
    echo = dataset.samples("test", normalise=True)[0]["echo"]
    assert echo.dtype == np.complex64
    raw = dataset.samples("test")[0]["echo"]
    np.testing.assert_allclose(echo * dataset.normalisation()["echo"].scale, raw, rtol=1e-6)


def test_constants_are_computed_once_and_kept_in_the_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = made(tmp_path, count=6, rooms={"count": 3})
    first = mmslam.open_dataset(store).normalisation()
    (held,) = attributes(store)[ATTRIBUTE].values()
    assert Constants(**held["echo"]) == first["echo"]
    monkeypatch.setattr("mmslam.learning.normalisation.sample_arrays", lambda root: 1 / 0)
    assert mmslam.open_dataset(store).normalisation() == first
    with pytest.raises(ZeroDivisionError):  # of other samples there are none yet
        mmslam.open_dataset(store).normalisation(part="test")


@pytest.mark.parametrize("workers", [1, 2, 5, 9])
def test_workers_stream_every_sample_once_and_share_no_file(store: Path, workers: int) -> None:
    stream = mmslam.open_dataset(store).stream("train", seed=3)
    seen = [[one["sample"] for one in stream.of_worker(w, workers)] for w in range(workers)]
    assert (
        sorted(number for some in seen for number in some)
        == mmslam.open_dataset(store).split()["train"].tolist()
    )
    files = [{number // 4 for number in some} for some in seen]
    assert sum(len(some) for some in files) == len(set.union(*files))


def test_an_epoch_has_its_own_order_and_the_same_again(store: Path) -> None:
    def order(epoch: int, **asked: Any) -> list[int]:
        stream = mmslam.open_dataset(store).stream(**asked)
        stream.set_epoch(epoch)
        return [one["sample"] for one in stream]

    assert order(1) == order(1) != order(2)
    assert order(1, shuffle=False) == list(range(24))
    samples = mmslam.open_dataset(store).samples()
    shuffled = list(samples.shuffled(seed=0, epoch=1))
    assert sorted(shuffled) == list(range(24))
    assert shuffled == list(samples.shuffled(seed=0, epoch=1))
    changes = np.count_nonzero(np.diff(np.array(shuffled) // 4))
    assert changes == 5  # six files, each gone through once


def test_a_copy_in_another_process_opens_the_store_by_itself(store: Path) -> None:
    samples = mmslam.open_dataset(store).samples("test", normalise=True)
    before = samples[0]["echo"]
    copied = pickle.loads(pickle.dumps(samples))
    assert copied._arrays is None
    np.testing.assert_array_equal(copied[0]["echo"], before)


def test_without_pytorch_the_extra_is_named(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "mmslam.learning.torch_dataset", raising=False)
    monkeypatch.setitem(sys.modules, "torch", None)  # as if it were not installed
    with pytest.raises(MeasurementError, match=r"install `mmslam\[torch\]`, or use \.samples"):
        mmslam.open_dataset(store).torch()


def test_nothing_of_pytorch_is_imported_before_it_is_asked_for() -> None:
    code = "import sys, mmslam; mmslam.open_dataset; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_datasets_of_pytorch_are_ours_with_its_base(store: Path, torch: Any) -> None:
    dataset = mmslam.open_dataset(store)
    by_index = dataset.torch("train", normalise=True)
    assert isinstance(by_index, torch.Dataset)
    np.testing.assert_array_equal(
        by_index[3]["echo"], dataset.samples("train", normalise=True)[3]["echo"]
    )
    stream = dataset.torch("train", stream=True, seed=0)
    assert isinstance(stream, torch.IterableDataset)
    assert len(list(stream)) == len(by_index)
    torch.get_worker_info = lambda: types.SimpleNamespace(id=1, num_workers=2)
    sys.modules["mmslam.learning.torch_dataset"].get_worker_info = torch.get_worker_info  # type: ignore[attr-defined]
    mine = [one["sample"] for one in stream]
    assert mine == [one["sample"] for one in dataset.stream("train").of_worker(1, 2)]
    assert 0 < len(mine) < len(by_index)


def test_pytorch_itself_batches_what_we_give(store: Path) -> None:
    data = pytest.importorskip("torch.utils.data")
    dataset = mmslam.open_dataset(store)
    for stream in (False, True):
        given = dataset.torch("train", stream=stream)
        loader = data.DataLoader(given, batch_size=5, num_workers=2)
        batches = list(loader)
        numbers = sorted(int(n) for batch in batches for n in batch["sample"])
        assert numbers == dataset.split()["train"].tolist()
        assert batches[0]["echo"].shape == (5, 6, 5)
        assert batches[0]["echo"].is_complex()


def test_a_folder_for_the_hub_holds_parts_constants_and_a_card(store: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app,
        ["export", str(store), "--huggingface", str(tmp_path / "hub"), "--license", "mit"],
    )
    assert done.exit_code == 0, done.output
    assert "train 18, validation 3, test 3" in done.output
    folder = tmp_path / "hub"
    _, front, card = (folder / "README.md").read_text(encoding="utf-8").split("---\n", 2)
    told = yaml.safe_load(front)
    assert told["license"] == "mit"
    assert told["size_categories"] == ["n<1K"]
    assert {one["name"]: one["num_examples"] for one in told["dataset_info"]["splits"]} == {
        "train": 18,
        "validation": 3,
        "test": 3,
    }
    assert 'base = "point_scatterers"' in card
    assert "[rooms]" in card
    constants = json.loads((folder / "normalisation.json").read_text(encoding="utf-8"))
    dataset = mmslam.open_dataset(store)
    assert constants["echo"]["scale"] == dataset.normalisation()["echo"].scale
    for part, numbers in dataset.split().items():
        copied = mmslam.open_dataset(folder / f"{part}.zarr")
        assert attributes(copied.path)["part"] == part
        assert attributes(copied.path)[ATTRIBUTE]["echo"] == constants["echo"]
        for new, old in enumerate(numbers):
            np.testing.assert_array_equal(sweep(copied, new), sweep(dataset, int(old)))
            mine, theirs = copied[new].truth, dataset[int(old)].truth
            np.testing.assert_array_equal(mine.user_position["ann"], theirs.user_position["ann"])
    # The configuration in the card makes the same dataset again.
    text = card.split("```toml\n")[1].split("```")[0]
    (tmp_path / "again.toml").write_text(text, encoding="utf-8")
    assert mmslam.make_dataset(tmp_path / "again.toml", tmp_path / "again.zarr").failed == 0
    again = mmslam.open_dataset(tmp_path / "again.zarr")
    np.testing.assert_array_equal(sweep(again, 7), sweep(dataset, 7))


def test_a_dataset_of_one_room_is_one_part_and_the_card_says_why(tmp_path: Path) -> None:
    store = made(tmp_path, count=4, rooms={"count": 1})
    done = CliRunner().invoke(app, ["export", str(store), "--huggingface", str(tmp_path / "hub")])
    assert done.exit_code == 0, done.output
    assert sorted(one.name for one in (tmp_path / "hub").iterdir()) == [
        "README.md",
        "normalisation.json",
        "train.zarr",
    ]
    card = (tmp_path / "hub" / "README.md").read_text(encoding="utf-8")
    assert "in one frozen room, so there is no test part" in card


def test_what_cannot_be_exported_for_the_hub_is_refused(store: Path, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    refused = CliRunner().invoke(
        app, ["export", str(store), "--huggingface", str(tmp_path / "full")]
    )
    assert refused.exit_code != 0
    assert "exists; move it away" in refused.output
    single = tmp_path / "one.zarr"
    mmslam.write(single, mmslam.open_dataset(store)[0])
    refused = CliRunner().invoke(app, ["export", str(single), "--huggingface", str(tmp_path / "a")])
    assert "no dataset" in refused.output
