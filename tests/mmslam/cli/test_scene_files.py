import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mmslam.cli import app
from scenes.files.loading import scenario_names


def mmslam(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture(autouse=True)
def _away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_an_export_holds_what_mmslam_sionna_and_blender_open(tmp_path: Path) -> None:
    code, listed, _ = mmslam("scenes", "slam_2d", "--export", "mine")
    assert code == 0
    files = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    assert set(listed.split()) == files
    assert {"mine/slam_2d.toml", "mine/slam_2d.xml", "mine/slam_2d_meshes/wall.ply"} < files
    code, shown, _ = mmslam("scenes", "mine/slam_2d_facets.toml", "--json")
    assert code == 0
    realisation = json.loads(shown)["objects"]["wall"]["realisation"]
    assert realisation == str(tmp_path / "mine" / "slam_2d_facets_meshes" / "wall.ply")


def test_another_seeds_wall_does_not_overwrite_the_first() -> None:
    assert mmslam("scenes", "slam_2d", "--export", "mine", "--seed", "1")[0] == 0
    assert mmslam("scenes", "slam_2d", "--export", "mine", "--seed", "1")[0] == 0
    code, _, message = mmslam("scenes", "slam_2d", "--export", "mine", "--seed", "2")
    assert code == 2
    assert "slam_2d_facets_meshes/wall.ply exists with other content" in message


def test_a_scenario_in_three_dimensions_is_drawn() -> None:
    code, drawn, _ = mmslam(
        "scenes", "bench_3d", "--set", "base_station.elements=[4, 4]", "--show", "--out", "b.png"
    )
    assert (code, drawn) == (0, "b.png\n")
    assert Path("b.png").read_bytes().startswith(b"\x89PNG")


def same_bytes(one: Path, other: Path) -> bool:
    files = [
        {path.relative_to(store): path.read_bytes() for path in store.rglob("*") if path.is_file()}
        for store in (one, other)
    ]
    return files[0] == files[1]


def test_an_exported_folder_can_be_moved_and_simulates_the_same(tmp_path: Path) -> None:
    given = tmp_path / "given"
    given.mkdir()
    (given / "board.csv").write_text("frequency_ghz,eps_real,eps_imag\n200,2.5,0.1\n300,2.6,0.1\n")
    cuts = ["radio.points=5", "base_station.elements=[2, 2]", "max_bounces=1"]
    cuts += ["objects.letter.scale=0.2", "objects.sphere.scale=0.0012"]
    cuts += [f"objects.letter.material={{file = '{given}/board.csv', thickness_mm = 3}}"]
    options = [part for cut in cuts for part in ("--set", cut)]
    code, listed, message = mmslam("scenes", "bench_3d", *options, "--export", "first")
    assert code == 0, message
    written = {"bench_3d_files/letter_f.ply", "bench_3d_files/sphere.ply"}
    written |= {"bench_3d_files/board.csv", "bench_3d.toml", "bench_3d_facets.toml"}
    assert {f"first/{name}" for name in written} < set(listed.split())
    assert len(listed.split()) == len(set(listed.split()))
    for file in Path("first").rglob("*.toml"):
        assert str(tmp_path) not in file.read_text()
    assert mmslam("simulate", "bench_3d", *options, "-o", "before.zarr")[0] == 0
    Path("first").rename("elsewhere")
    (given / "board.csv").unlink()
    code, _, message = mmslam("simulate", "elsewhere/bench_3d.toml", "-o", "after.zarr")
    assert code == 0, message
    assert same_bytes(Path("before.zarr"), Path("after.zarr"))
    code, _, message = mmslam("scenes", "elsewhere/bench_3d_facets.toml")
    assert code == 0, message


def test_every_scenario_is_exported_with_the_meshes_it_needs() -> None:
    assert mmslam("scenes", "--export", "all")[0] == 0
    Path("all").rename("moved")
    names = {path.stem for path in Path("moved").glob("*.toml")}
    assert names == set(scenario_names())
    for name in names:
        assert mmslam("scenes", f"moved/{name}.toml")[0] == 0


def test_a_new_scenario_is_written_without_a_question_and_simulates(tmp_path: Path) -> None:
    code, told, _ = mmslam("scenes", "--new", "my.room.toml")
    assert (code, told.strip()) == (0, "my.room.toml")
    path = tmp_path / "my.room.toml"
    assert path.read_text().count("#") > 20  # it is commented
    code, told, _ = mmslam("simulate", "my.room.toml", "-o", "m.zarr", "--json")
    assert code == 0
    assert json.loads(told)["users"] == ["ann"]


def test_a_new_scenario_replaces_no_other_file(tmp_path: Path) -> None:
    assert json.loads(mmslam("scenes", "--new", "room.toml", "--json")[1]) == {"file": "room.toml"}
    assert mmslam("scenes", "--new", "room.toml")[0] == 0  # the same again
    (tmp_path / "room.toml").write_text("name = 'mine'")
    code, _, told = mmslam("scenes", "--new", "room.toml")
    assert code == 2
    assert "exists with other content" in told
    code, _, told = mmslam("scenes", "--new", "room.json")
    assert code == 2
    assert "call it room.toml" in told
    assert mmslam("scenes", "slam_2d", "--new", "other.toml")[0] == 2
