"""A frequency grid too coarse for the scene is noted, with the number of points that would do."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario, scenario_names
from scenes.scenario import Scenario, parse_scenario
from simulator.scene.unambiguous_range import farthest_point, range_notes

STEP = 50e6  # [Hz]; echoes are unambiguous up to 2.998 m, pilots to 5.996 m


def hall(*, user: float = 2.0, points: int = 41, **objects: dict[str, Any]) -> Scenario:
    return parse_scenario(
        {
            "name": "hall",
            "radio": {
                "start_ghz": 28.0,
                "stop_ghz": 28.0 + 1e-9 * STEP * (points - 1),
                "points": points,
            },
            "base_station": {"elements": 4, "spacing_mm": 5.0},
            "objects": objects,
            "users": {"ann": {"position_m": [0.0, user]}},
        }
    )


def wall(distance: float) -> dict[str, Any]:
    return {"kind": "plate", "material": "metal", "centre_m": [0.0, distance], "length_m": 0.1}


def test_a_wall_beyond_the_echoes_unambiguous_range_is_noted_and_a_nearer_one_is_not() -> None:
    limit = speed_of_light / (2 * STEP)
    assert range_notes(hall(near=wall(limit - 0.01))) == ()
    (note,) = range_notes(hall(far=wall(limit + 0.01), near=wall(1.0)))
    assert "up to c/2Δf = 3 m, and objects.far reaches to 3.01 m" in note
    assert "set radio.points to 42 or more" in note


def test_a_user_beyond_the_pilots_unambiguous_range_is_noted() -> None:
    assert range_notes(hall(user=5.9)) == ()
    (note,) = range_notes(hall(user=6.1))
    assert "pilots are unambiguous up to c/Δf = 6 m, and users.ann is 6.1 m" in note


def test_the_points_asked_for_are_enough_and_one_fewer_is_not() -> None:
    far = wall(7.3)
    (note,) = range_notes(hall(far=far))
    needed = int(note.split("set radio.points to ")[1].split()[0])
    for points, told in ((needed, 0), (needed - 1, 1)):
        band = {"start_ghz": 28.0, "stop_ghz": 28.0 + 1e-9 * STEP * 40, "points": points}
        scene = hall(far=far).model_dump(exclude_unset=True) | {"radio": band}
        assert len(range_notes(parse_scenario(scene))) == told


def test_the_farthest_point_of_a_body_is_one_of_its_corners() -> None:
    box = {"kind": "box", "material": "metal", "centre_m": [1.0, 2.0], "angle_deg": 90.0,
           "length_m": 2.0, "depth_m": 1.0}  # fmt: skip
    post = {"kind": "cylinder", "material": "metal", "centre_m": [-1.5, 2.0], "radius_m": 0.5}
    scene = hall(box=box, post=post)
    assert farthest_point(scene.objects["post"], np.zeros(3)) == pytest.approx(3.0)
    assert farthest_point(scene.objects["box"], np.zeros(3)) == pytest.approx(np.hypot(1.5, 3.0))


@pytest.mark.parametrize("name", scenario_names())
def test_no_scenario_of_the_library_is_too_coarse_for_its_walls(name: str) -> None:
    assert range_notes(load_scenario(name)) == ()
