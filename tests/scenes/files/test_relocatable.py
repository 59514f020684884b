from pathlib import Path
from typing import Any

import trimesh

from scenes.files.loading import load_scenario
from scenes.files.relocatable import relocatable
from scenes.scenario import Scenario, parse_scenario


def scenario(**objects: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "some",
            "dimensions": 3,
            "radio": {"start_ghz": 57.0, "stop_ghz": 60.0, "points": 3},
            "base_station": {"elements": [2, 2], "spacing_mm": 2.0},
            "objects": objects,
        }
    )


def mesh(file: Path, y: float) -> dict[str, Any]:
    return {"kind": "mesh", "material": "metal", "file": str(file), "centre_m": [0.0, y, 0.0]}


def test_files_of_one_name_are_told_apart_and_one_file_is_kept_once(tmp_path: Path) -> None:
    for folder, size in (("a", 0.1), ("b", 0.2)):
        (tmp_path / folder).mkdir()
        trimesh.creation.box(extents=(size, size, size)).export(tmp_path / folder / "it.ply")
    first, second = tmp_path / "a/it.ply", tmp_path / "b/it.ply"
    moved = relocatable(
        scenario(one=mesh(first, 1.0), two=mesh(second, 2.0), again=mesh(first, 3.0))
    )
    assert moved.files == {"some_files/it.ply": first, "some_files/it_2.ply": second}
    files = [body["file"] for body in moved.tables["objects"].values()]
    assert files == ["some_files/it.ply", "some_files/it_2.ply", "some_files/it.ply"]


def test_a_scenario_without_files_is_as_it_was(tmp_path: Path) -> None:
    scene = load_scenario("slam_2d")
    moved = relocatable(scene)
    assert moved.files == {}
    (tmp_path / "it.toml").write_text(moved.toml)
    assert load_scenario(str(tmp_path / "it.toml")) == scene
