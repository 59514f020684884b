import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mmslam.cli import app


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
    assert json.loads(shown)["objects"]["wall"]["facets"] == "file"


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
