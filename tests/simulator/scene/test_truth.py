import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.measurement.model import Measurement, Uplink
from estimator.measurement.store import write_measurement
from scenes.files.loading import load_scenario
from scenes.scenario import Scenario, parse_scenario
from simulator.scene.truth import scenario_truth
from validation.metrics.truth import Truth, front_face, read_truth


def scenario(**tables: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "small",
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 11},
            "base_station": {"elements": 4, "spacing_mm": 0.5},
            **tables,
        }
    )


def stored(scene: Scenario, folder: Path) -> Truth:
    """The truth as it comes back from a file."""
    pilot = Uplink(
        samples=np.ones((1, 2), dtype=np.complex128),
        positions=np.zeros((1, 3)),
        frequencies=np.array([1e9, 2e9]),
        user="ann",
    )
    measurement = Measurement(echo=None, uplinks=(pilot,))
    write_measurement(folder / "m.zarr", measurement, truth=scenario_truth(scene))
    return read_truth(folder / "m.zarr")


def test_targets_come_back_with_where_and_how_large_they_are(tmp_path: Path) -> None:
    metal = {"material": "metal"}
    truth = stored(
        scenario(
            objects={
                "post": {**metal, "kind": "cylinder", "centre_m": [0.5, 0.8], "radius_m": 0.01},
                "crate": {
                    **metal, "kind": "box", "centre_m": [0.2, 0.6], "length_m": 0.1,
                    "depth_m": 0.04, "angle_deg": 30.0,
                },
                "wall": {**metal, "kind": "plate", "centre_m": [0.0, 0.9], "length_m": 0.1},
                "shade": {
                    "material": "absorber", "kind": "box", "centre_m": [-0.4, 0.6],
                    "length_m": 0.1, "depth_m": 0.1,
                },
            },
            points={
                "spot": {"position_m": [-0.1, 0.5], "rcs_m2": 1.0},
                "post": {"position_m": [-0.2, 0.5], "rcs_m2": 1.0},
            },
        ),
        tmp_path,
    )  # fmt: skip
    assert truth.target_kind == {
        "post": "cylinder", "crate": "box", "spot": "point", "points.post": "point",
    }  # fmt: skip
    np.testing.assert_array_equal(truth.target_position["post"], [0.5, 0.8, 0.0])
    np.testing.assert_array_equal(truth.target_position["points.post"], [-0.2, 0.5, 0.0])
    np.testing.assert_array_equal(truth.target_size["post"], [0.02, 0.02, 0.0])
    np.testing.assert_array_equal(truth.target_size["crate"], [0.1, 0.04, 0.0])
    np.testing.assert_array_equal(truth.target_size["spot"], [0.0, 0.0, 0.0])
    assert truth.target_angle["crate"] == pytest.approx(math.pi / 6)
    assert set(truth.wall_start) == {"wall"}
    # Straight below the middle of the box's lower face, along that face's normal.
    normal = np.array([math.sin(math.pi / 6), -math.cos(math.pi / 6), 0.0])
    seen = front_face(truth, "crate", truth.target_position["crate"] + 0.5 * normal)
    np.testing.assert_allclose(seen, [0.2 + 0.02 * normal[0], 0.6 + 0.02 * normal[1], 0])


def test_a_mesh_is_a_target_by_its_bounding_box(tmp_path: Path) -> None:
    scene = load_scenario("bench_3d", ["base_station.elements=[4, 4]"])
    truth = stored(scene, tmp_path)
    assert truth.target_kind["sphere"] == "mesh"
    # The file's single precision; its faces keep within 6 µm of the sphere of 6 mm.
    np.testing.assert_allclose(truth.target_position["sphere"], [0.025, 0.31, 0.005], atol=1e-6)
    np.testing.assert_allclose(truth.target_size["sphere"], [0.012] * 3, atol=12e-6)
    assert truth.target_position["letter"][1] == pytest.approx(0.34, abs=0.01)


def test_the_truth_of_a_scene_without_targets_holds_none(tmp_path: Path) -> None:
    truth = stored(scenario(users={"ann": {"position_m": [0.1, 0.4]}}), tmp_path)
    assert not truth.target_position
    assert not truth.target_kind
    assert list(truth.user_position) == ["ann"]
