import math
from collections.abc import Mapping

import numpy as np
import pytest

from scenes.files.loading import load_scenario
from scenes.scenario import Scenario, parse_scenario
from simulator.geometry.mean_surfaces import mean_mirrors, mean_surfaces
from simulator.scene.radio_scene import scenario_materials
from simulator.scene.scenario_paths import scenario_paths

BASE = {
    "name": "made",
    "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 11},
    "base_station": {"elements": 3, "spacing_mm": 0.5},
}
WALL = {
    "kind": "plate", "material": "metal", "centre_m": [0.0, 0.6], "angle_deg": 45.0,
    "length_m": 0.3,
}  # fmt: skip
POST = {"kind": "cylinder", "material": "metal", "centre_m": [0.4, 0.6], "radius_m": 0.005}
SCREEN = {
    "kind": "plate", "material": "absorber", "centre_m": [0.14, 0.25], "angle_deg": 90.0,
    "length_m": 0.3,
}  # fmt: skip


def scenario(objects: Mapping[str, object], **more: object) -> Scenario:
    return parse_scenario(BASE | {"objects": objects} | more)


def test_the_users_paths_are_those_of_the_mirror_image() -> None:
    direct, over = scenario_paths(load_scenario("los_and_nlos_user"))
    # Section 6 of the design: 0.901 m / 56.3° and 1.301 m / 92.2°
    image = np.array([-0.05, 1.3, 0.0])  # (0.50, 0.75) mirrored about the 45° line through (0, 0.8)
    assert (direct.bounces, over.bounces) == (0, 1)
    assert direct.length == pytest.approx(math.hypot(0.50, 0.75), rel=1e-12)
    assert over.length == pytest.approx(float(np.linalg.norm(image)), rel=1e-12)
    for path, angle in ((direct, 56.3), (over, 92.2)):
        way = path.vertices[1] - path.vertices[0]
        assert math.degrees(math.atan2(way[1], way[0])) == pytest.approx(angle, abs=0.05)


def test_a_path_is_as_faint_as_the_users_beam_in_its_direction() -> None:
    direct, over = scenario_paths(load_scenario("slam_2d"))
    off_axis = math.atan2(0.8, 1.0)  # the beam looks along -x
    assert over.gain_db == pytest.approx(0.0, abs=1e-9)
    assert direct.gain_db == pytest.approx(
        20 * math.log10(math.exp(-(off_axis**2) / (2 * 0.1**2))), rel=1e-9
    )


def test_a_hidden_post_is_reached_over_the_wall_only_and_at_its_front() -> None:
    objects = {"wall": WALL, "post": POST, "screen": SCREEN}
    (path,) = scenario_paths(scenario(objects))
    assert (path.end, path.kind, path.bounces) == ("post", "object", 1)
    # 0.6 m to the wall's centre, 0.4 m to the post's, less its radius: the places lie 0.25 mm
    # apart on 64 chords that are 6 µm inside of the circle.
    assert path.length == pytest.approx(1.0 - 0.005, abs=1e-5)
    np.testing.assert_allclose(path.vertices[1], [0.0, 0.6, 0.0], atol=1e-3)
    del objects["screen"]
    assert sorted(path.bounces for path in scenario_paths(scenario(objects))) == [0, 1]


def test_a_box_is_reached_at_the_face_that_looks_back() -> None:
    box = {
        "kind": "box", "material": "cardboard", "centre_m": [0.42, 0.6], "length_m": 0.1,
        "depth_m": 0.1,
    }  # fmt: skip
    (path,) = scenario_paths(scenario({"wall": WALL, "box": box, "screen": SCREEN}))
    np.testing.assert_allclose(path.vertices[-1], [0.37, 0.6, 0.0], atol=1e-12)
    assert path.length == pytest.approx(0.97, rel=1e-12)


def test_a_path_over_the_middle_of_a_wall_in_3d_has_one_mirror() -> None:
    wall = WALL | {"height_m": 0.2}
    box = {
        "kind": "box", "material": "metal", "centre_m": [-0.5, 0.0], "angle_deg": 30.0,
        "length_m": 0.2, "depth_m": 0.1, "height_m": 0.3,
    }  # fmt: skip
    made = scenario(
        {"wall": wall, "box": box},
        dimensions=3,
        users={"user": {"position_m": [0.4, 0.6, 0.0]}},
    )
    surfaces = mean_surfaces(made)
    mirrors = mean_mirrors(made, surfaces, scenario_materials(made))
    assert len(mirrors) == 1 + 6
    assert mirrors.two_sided.tolist() == [True] + [False] * 6
    # Rectangles with their corners in order around the edge: areas and outward normals
    sides = np.linalg.norm(np.diff(mirrors.corners[1:], axis=1), axis=-1)
    areas = sides[:, 0] * sides[:, 1]
    assert sorted(areas) == pytest.approx([0.02, 0.02, 0.03, 0.03, 0.06, 0.06])
    outward = mirrors.corners[1:].mean(axis=1) - made.objects["box"].centre
    assert np.all(np.einsum("mx,mx->m", outward, mirrors.normals[1:]) > 0)
    paths = [path for path in scenario_paths(made) if path.kind == "user"]
    over_the_wall = [path for path in paths if path.bounces == 1]
    assert len(over_the_wall) == 1
    np.testing.assert_allclose(over_the_wall[0].vertices[1], [0.0, 0.6, 0.0], atol=1e-12)


def test_without_mirrors_there_is_the_line_of_sight_alone() -> None:
    made = scenario({"post": POST}, users={"user": {"position_m": [0.2, 0.3]}})
    assert [(path.end, path.bounces) for path in scenario_paths(made)] == [
        ("user", 0),
        ("post", 0),
    ]


def test_an_empty_scenario_has_no_paths() -> None:
    assert scenario_paths(scenario({})) == ()
