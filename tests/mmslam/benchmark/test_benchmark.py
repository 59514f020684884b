"""The public benchmark: recipes, parts, scores, and what an outsider does with them."""

import filecmp
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from typer.testing import CliRunner

from estimator.measurement.model import MeasurementError
from estimator.measurement.store import read_measurement
from mmslam.benchmark import find_mirrors, predict_channel
from mmslam.benchmark import recipe as recipes
from mmslam.benchmark.bootstrap import metric, quantile
from mmslam.benchmark.making import make_part, store_digest
from mmslam.benchmark.recipe import TRACKS, load_recipe
from mmslam.benchmark.reference_methods import predict
from mmslam.benchmark.scoring import score
from mmslam.benchmark.truth import SampleTruth, part_truth, true_channels
from mmslam.cli import app
from mmslam.output import OutputError
from scenes.files.toml_reader import read_toml
from scenes.schema.errors import ScenarioError

SIZE = 2
OUTSIDER = Path(__file__).with_name("outsider.py")


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("benchmark")
    for track in ("user", "channel"):
        make_part(track, "test", folder, size=SIZE)
    return folder


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["benchmark", *map(str, arguments)])


def written(folder: Path, text: str, name: str = "it.csv") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def user_file(folder: Path, places: np.ndarray) -> Path:
    rows = [f"{n},{x!r},{y!r}" for n, (x, y) in enumerate(places.tolist())]
    return written(folder, "\n".join(["sample,x_m,y_m", *rows]))


# Recipes


@pytest.mark.parametrize("track", TRACKS)
def test_a_recipe_is_what_its_digest_says_and_its_parts_share_no_room(track: str) -> None:
    recipe = load_recipe(track)
    assert recipe.name == track
    seeds = [one.seed for one in recipe.parts.values()]
    assert len(set(seeds)) == len(seeds) == 3
    walls = [tuple(part_truth(recipe, part, 1)[0].walls.ravel()) for part in recipe.parts]
    assert len(set(walls)) == 3


def test_a_changed_recipe_or_base_scenario_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def changed(*given: Any, **named: Any) -> dict[str, Any]:
        tables = read_toml(*given, **named)
        tables["parts"]["test"]["seed"] += 1
        return tables

    with monkeypatch.context() as patch:
        patch.setattr(recipes, "read_toml", changed)
        with pytest.raises(ScenarioError, match="is another benchmark: give it a version"):
            load_recipe("user")
    monkeypatch.setattr(recipes, "identity", lambda space: {"base": "another"})
    with pytest.raises(ScenarioError, match="its content or its base scenario was changed"):
        load_recipe("user")


def test_a_sample_is_the_same_in_a_part_of_any_size() -> None:
    recipe = load_recipe("mirrors")
    few, many = (part_truth(recipe, "test", size) for size in (3, 7))
    for one, other in zip(few, many, strict=False):
        np.testing.assert_array_equal(one.walls, other.walls)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (("walls", "test", None), "give one of mirrors, user, channel"),
        (("user", "dev", None), "give one of train, validation, test"),
        (("user", "test", 0), "give 1 or more samples"),
    ],
)
def test_what_there_is_not_is_refused(tmp_path: Path, asked: Any, told: str) -> None:
    track, part, size = asked
    with pytest.raises(ScenarioError, match=told):
        make_part(track, part, tmp_path, size=size)


# Parts


def test_a_part_is_made_again_byte_for_byte(parts: Path, tmp_path: Path) -> None:
    done = run("make", "user", "--part", "test", "--size", SIZE, "--out", tmp_path, "--workers", 0)
    assert done.exit_code == 0, done.output
    one, other = parts / "user-test.zarr", tmp_path / "user-test.zarr"
    files = [sorted(p.relative_to(s) for p in s.rglob("*") if p.is_file()) for s in (one, other)]
    assert files[0] == files[1]
    assert filecmp.cmpfiles(one, other, files[0], shallow=False)[1:] == ([], [])
    manifests = [json.loads(s.with_suffix(".json").read_text()) for s in (one, other)]
    assert manifests[0] == manifests[1]
    assert manifests[0]["digest"] == store_digest(one)
    assert manifests[0]["recipe"] == load_recipe("user").digest
    assert not list(tmp_path.glob("*.making"))
    with pytest.raises(OutputError, match="exists; move it away"):
        make_part("user", "test", tmp_path, size=SIZE)


def test_a_digest_follows_no_link(tmp_path: Path) -> None:
    store, outside = tmp_path / "a.zarr", tmp_path / "outside"
    (store / "echo").mkdir(parents=True)
    (store / "echo" / "0").write_bytes(b"samples")
    whole = store_digest(store)
    outside.mkdir()
    (outside / "secret").write_bytes(b"secret")
    for target in (outside / "secret", outside, store / "echo" / "0", outside / "nowhere"):
        (store / "link").symlink_to(target)
        with pytest.raises(OutputError, match=r"a\.zarr/link is a link"):
            store_digest(store)
        (store / "link").unlink()
    assert store_digest(store) == whole


@pytest.mark.parametrize("track", ["user", "channel"])
def test_the_test_part_holds_inputs_and_no_answer(parts: Path, track: str) -> None:
    root = zarr.open_group(parts / f"{track}-test.zarr", mode="r")
    names = {path for path, _ in root.members(max_depth=None)}
    assert not [name for name in names if name.startswith(("truth", "parameters"))]
    assert not names & {"room", "redraws", "failure"}
    assert not set(root.attrs) & {"config", "base", "seed"}
    assert ("uplink" in names) == (track == "user")
    assert ("user_position" in names) == (track == "channel")
    assert "echo" in names
    # Without it the users' clock would be unknown, and no delay a length.
    assert read_measurement(parts / f"{track}-test.zarr", sample=0).clock_offset == 0.0


def test_a_training_part_holds_its_truth(tmp_path: Path) -> None:
    make_part("mirrors", "train", tmp_path, size=1)
    root = zarr.open_group(tmp_path / "mirrors-train.zarr", mode="r")
    true = part_truth(load_recipe("mirrors"), "train", 1)[0].walls
    starts = np.asarray(root["truth/wall_start"])[0, : len(true), :2]
    np.testing.assert_allclose(starts, true[:, 0], atol=1e-12)


# Scores


def test_an_outsider_predicts_and_is_scored_by_one_command(parts: Path) -> None:
    alone = subprocess.run(
        [sys.executable, str(OUTSIDER), str(parts)], capture_output=True, cwd=parts, text=True
    )
    assert alone.returncode == 0, alone.stderr
    done = run("score", "user", parts / "user.csv", "--size", SIZE)
    assert done.exit_code == 0, done.output
    assert "median error" in done.output
    told = json.loads((parts / "user.score.json").read_text())
    # It takes the wall's image for the user: off by twice the distance behind the wall.
    assert 100 < told["metrics"]["median error"]["value"] < 3000
    assert told["samples"] == SIZE
    done = run("score", "channel", parts / "channel.csv", "--size", SIZE, "--json")
    found = json.loads(done.stdout)
    # The direct path is one of two or three of like level: a correlation of 0.4 to 0.95.
    assert 0.4 < found["metrics"]["median similarity"]["value"] < 0.99
    again = run("score", "user", parts / "user.csv", "--size", SIZE, "--json")
    assert {**told, "file": str(parts / "user.score.json")} == json.loads(again.stdout)
    (parts / "mine.json").write_text("{}")
    refused = run("score", "user", parts / "user.csv", "--size", SIZE, "-o", parts / "mine.json")
    assert refused.exit_code == 2
    assert "is no score" in refused.output


def test_the_truth_itself_scores_without_an_error(tmp_path: Path) -> None:
    recipe = load_recipe("user")
    users = np.array([one.user for one in part_truth(recipe, "test")])
    found = score("user", user_file(tmp_path, users))["metrics"]
    assert found["90 % error"]["value"] == 0.0
    assert found["found"]["value"] == found["within 10 mm"]["value"] == 1.0
    walls = part_truth(load_recipe("mirrors"), "test")
    rows = [
        f"{n},{','.join(map(repr, w.ravel().tolist()))}"
        for n, t in enumerate(walls)
        for w in t.walls
    ]
    file = written(tmp_path, "\n".join(["sample,x1_m,y1_m,x2_m,y2_m", *rows]), "walls.csv")
    found = score("mirrors", file)["metrics"]
    assert found["F1"]["value"] == found["recall"]["low"] == 1.0
    assert found["median offset error"]["value"] == pytest.approx(0.0, abs=1e-9)


def test_errors_are_distances_and_one_not_found_errs_without_bound(tmp_path: Path) -> None:
    users = np.array([one.user for one in part_truth(load_recipe("user"), "test", 10)])
    file = user_file(tmp_path, users + np.array([0.003, 0.004]))
    found = score("user", file, size=10)["metrics"]
    assert found["median error"]["value"] == pytest.approx(5.0, rel=1e-9)
    assert found["median error"]["low"] == pytest.approx(found["median error"]["high"])
    lines = file.read_text().splitlines()
    told = ["sample,x_m,y_m,found", *(f"{line},{int(n > 5)}" for n, line in enumerate(lines[1:]))]
    told = [
        line.replace(line.split(",", 1)[1], ",,0") if line.endswith(",0") else line for line in told
    ]
    found = score("user", written(tmp_path, "\n".join(told)), size=10)["metrics"]
    assert found["found"]["value"] == pytest.approx(0.4)
    assert found["median error"]["value"] is None
    assert found["within 10 mm"]["value"] == pytest.approx(0.4)


def truth_of(*walls: Any) -> SampleTruth:
    return SampleTruth(user=np.zeros(2), walls=np.array(walls, dtype=float), difficulty={})


def test_a_mirror_is_right_on_a_wall_and_along_it() -> None:
    wall = ((0.0, 1.0), (0.4, 1.0))
    other = ((1.0, 0.0), (1.0, 0.4))
    shifted = [(0.1, 1.004), (0.3, 1.004)]
    tilted = [(0.1, 1.0), (0.3, 1.0 + 0.2 * np.tan(np.radians(2.0)))]
    beyond = [(0.2, 1.0), (0.8, 1.0)]
    truth = [truth_of(wall, other)] * 2
    found = find_mirrors.metrics(
        [np.array([shifted, tilted, beyond]), np.array([shifted, shifted])], truth
    )
    assert found["precision"].value == pytest.approx(3 / 5)
    assert found["recall"].value == pytest.approx(2 / 4)  # two segments on one wall find it once
    assert found["F1"].value == pytest.approx(2 * 0.6 * 0.5 / 1.1)
    assert found["median offset error"].value == pytest.approx(4.0)
    nothing = find_mirrors.metrics([np.zeros((0, 2, 2))] * 2, truth)
    assert nothing["F1"].value == 0.0
    assert nothing["precision"].value is None


def test_channels_are_compared_with_and_without_their_phase() -> None:
    rng = np.random.default_rng(0)
    truth = rng.normal(size=(3, 4, 5)) + 1j * rng.normal(size=(3, 4, 5))
    turned = predict_channel.metrics(1j * truth, truth)
    assert turned["median similarity"].value == pytest.approx(1.0)
    assert turned["median NMSE"].value == pytest.approx(10 * np.log10(2))  # |1 − j|²
    doubled = predict_channel.metrics(2 * truth, truth)
    assert doubled["median level error"].value == pytest.approx(20 * np.log10(2))
    silent = predict_channel.metrics(0 * truth, truth)
    assert silent["median similarity"].value == 0.0
    assert silent["median level error"].value is None
    assert silent["median NMSE"].value == pytest.approx(0.0, abs=1e-9)


def test_the_interval_of_a_mean_is_that_of_its_deviation() -> None:
    values = np.random.default_rng(1).normal(size=400)
    found = metric(lambda x: float(x.mean()), values, unit="1")
    half = 1.96 * values.std() / 20
    assert found.low is not None
    assert found.high is not None
    # An end of 2000 resamples scatters by some 4 % of the half width; 4 deviations.
    assert found.low == pytest.approx(values.mean() - half, abs=0.16 * half)
    assert found.high == pytest.approx(values.mean() + half, abs=0.16 * half)
    some = metric(quantile(0.5), np.array([1.0, 2.0, 3.0, np.inf, np.inf]), unit="m")
    assert (some.value, some.high) == (3.0, None)


def test_the_true_channel_is_that_of_the_noise_free_pilot(parts: Path, tmp_path: Path) -> None:
    recipe = load_recipe("channel")
    truth = true_channels(recipe, "test", SIZE)
    make_part("channel", "validation", tmp_path, size=1)
    root = zarr.open_group(tmp_path / "channel-validation.zarr", mode="r")
    rows, columns = np.linspace(0, 95, 16).round(), np.linspace(0, 200, 32).round()
    noisy = np.asarray(root["uplink"])[0, 0][np.ix_(rows.astype(int), columns.astype(int))]
    quiet = true_channels(recipe, "validation", 1)[0]
    error = np.mean(np.abs(noisy - quiet) ** 2) / np.mean(np.abs(quiet) ** 2)
    # 40 dB SNR; 512 exponential values scatter by 4 %, and the grid's mean power from the
    # whole array's by some 10 %.
    assert 10 * np.log10(error) == pytest.approx(-40.0, abs=1.5)
    assert truth.shape == (SIZE, 16, 32)


# Reference methods


def test_the_estimator_beats_the_strongest_path_behind_a_wall(parts: Path, tmp_path: Path) -> None:
    found = {}
    for method in ("estimator", "single_array", "chance"):
        file = tmp_path / f"{method}.csv"
        assert predict("user", parts / "user-test.zarr", file, method=method) == SIZE
        found[method] = score("user", file, size=SIZE)["metrics"]["median error"]["value"]
    # A cell of 20 mm; what is taken as direct is off by the wall's image.
    assert found["estimator"] < 20 < 200 < found["single_array"]
    assert 20 < found["chance"] < 500


def test_what_cannot_be_predicted_is_refused(parts: Path, tmp_path: Path) -> None:
    store = parts / "user-test.zarr"
    with pytest.raises(MeasurementError, match="give one of estimator, single_array, chance"):
        predict("user", store, tmp_path / "it.csv", method="magic")
    with pytest.raises(MeasurementError, match="no part of track mirrors"):
        predict("mirrors", store, tmp_path / "it.csv")
    with pytest.raises(MeasurementError, match=r"written as \.csv"):
        predict("user", store, tmp_path / "it.parquet")


# Commands


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("make",), "needs a TRACK"),
        (("make", "user"), "needs --out DIR"),
        (("score", "user"), "needs a file of predictions"),
        (("baseline", "user", "a.zarr"), "needs the part's .zarr"),
    ],
)
def test_incomplete_commands_are_refused(arguments: tuple[str, ...], told: str) -> None:
    refused = run(*arguments)
    assert refused.exit_code == 2
    assert told in " ".join(refused.output.split())


def test_the_tracks_are_listed() -> None:
    found = json.loads(run("tracks", "--json").stdout)
    assert list(found) == list(TRACKS)
    assert found["user"]["recipe"] == load_recipe("user").digest
