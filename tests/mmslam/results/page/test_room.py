"""The page of a scenario in space."""

import tomllib
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from mmslam.results.page.room import MOST_FACES, room_document
from scenes.files.loading import load_scenario
from scenes.scenario import Scenario, parse_scenario
from simulator.scene.scenario_paths import scenario_paths


def room(**objects: dict[str, Any]) -> Scenario:
    text = files("scenes").joinpath("library/room_3d.toml").read_text(encoding="utf-8")
    tables = {**tomllib.loads(text), "objects": objects}
    return parse_scenario(tables)


@pytest.fixture(scope="module")
def furnished() -> dict[str, Any]:
    scenario = load_scenario("room_3d")
    return room_document(scenario, scenario_paths(scenario))


def things(document: dict[str, Any], layer: str) -> list[dict[str, Any]]:
    return [thing for thing in document["things"] if thing["layer"] == layer]


def test_every_object_is_in_the_page_by_its_name(furnished: dict[str, Any]) -> None:
    labels = [label for thing in things(furnished, "objects") for label in thing["labels"]]
    names = {label.split(":")[0] for label in labels}
    assert names == set(load_scenario("room_3d").objects)


def test_each_vertex_has_the_label_of_its_own_object(furnished: dict[str, Any]) -> None:
    scenario = load_scenario("room_3d")
    for thing in things(furnished, "objects"):
        points = np.array(thing["points"])
        assert len(points) == len(thing["label_of"])
        assert np.max(thing["triangles"]) < len(points)
        for number, label in enumerate(thing["labels"]):
            own = points[np.array(thing["label_of"]) == number]
            body = scenario.objects[label.split(":")[0]]
            # Round a body that is centred, its vertices are on all sides of the middle.
            assert np.all(own.min(axis=0) <= body.centre + 1e-5)
            assert np.all(own.max(axis=0) >= body.centre - 1e-5)


def test_the_edges_of_a_box_are_twelve(furnished: dict[str, Any]) -> None:
    box = {"kind": "box", "centre_m": [0.6, 1.0], "length_m": 0.3, "depth_m": 0.2}
    scenario = room(crate={**box, "height_m": 0.4, "material": "wood"})
    document = room_document(scenario, [])
    (edges,) = things(document, "edges")
    lines = np.array(edges["points"], dtype=float).reshape(-1, 3, 3)
    assert len(lines) == 12  # the diagonals of its faces are left out
    lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    np.testing.assert_allclose(np.sort(lengths), np.repeat([0.2, 0.3, 0.4], 4), atol=1e-4)


def test_lines_of_a_plane_scene_stand_up_as_strips() -> None:
    document = room_document(load_scenario("slam_2d"), [])
    (faces,) = things(document, "objects")
    heights = np.array(faces["points"])[:, 2]
    assert heights.min() == pytest.approx(-heights.max())
    assert heights.max() > 0.01


def test_a_path_tells_its_length_and_reflections(furnished: dict[str, Any]) -> None:
    paths = scenario_paths(load_scenario("room_3d"))
    told = [
        thing["text"]
        for layer in ("paths to users", "faint paths")
        for thing in things(furnished, layer)
    ]
    assert len(told) == len(paths)
    longest = max(paths, key=lambda path: path.length)
    assert any(f"{longest.length:.4f} m, {longest.bounces} reflection" in text for text in told)


def test_a_fine_mesh_is_thinned_to_what_a_browser_turns(furnished: dict[str, Any]) -> None:
    faces = sum(len(thing["triangles"]) for thing in things(furnished, "objects"))
    assert faces <= MOST_FACES
