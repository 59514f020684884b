"""Samples in frozen rooms: what is the same in a room, and what is each sample's own."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from scenes.schema.errors import ScenarioError
from simulator.dataset.builder import make_dataset, plan_dataset
from simulator.dataset.task_runner import Workers

SMALL: dict[str, Any] = {
    "base": "slam_2d",
    "seed": 4,
    "set": {
        "base_station.elements": 24,
        "radio.stop_ghz": 230.0,
        "radio.points": 41,
        "objects.wall.length_m": 0.2,
        "objects.wall.roughness.rms_mm": 0.15,
        "noise.snr_db": 100.0,
    },
}
NEAR = {"users.user.position_m": {"kind": "in_box", "low_m": [0.9, 0.8], "high_m": [0.90001, 0.8]}}
SHIFTED = {"kind": "in_box", "low_m": [0.0, 0.8], "high_m": [0.00001, 0.8]}
TURNED = {"objects.wall.angle_deg": {"kind": "uniform", "low": 43.0, "high": 47.0}}


def made(folder: Path, **changes: Any) -> tuple[xr.Dataset, xr.Dataset]:
    job = plan_dataset({**SMALL, **changes}, folder / "it.zarr")
    assert make_dataset(job, workers=Workers()).failed == 0
    root = xr.open_zarr(job.target, consolidated=False).load()
    return root, xr.open_zarr(job.target, group="parameters", consolidated=False).load()


def alike(one: np.ndarray, other: np.ndarray) -> float:
    """Return the magnitude of the normalised correlation of two sweeps."""
    one, other = one.astype(np.complex128), other.astype(np.complex128)
    product = abs(np.vdot(one, other))
    return float(product / (np.linalg.norm(one) * np.linalg.norm(other)))


def test_the_walls_of_a_room_stay_while_users_move(tmp_path: Path) -> None:
    frozen, _ = made(tmp_path, count=2, vary=NEAR, rooms={"count": 1})
    (tmp_path / "it.zarr").rename(tmp_path / "other.zarr")
    redrawn, _ = made(tmp_path, count=2, vary=NEAR)
    # At 100 dB SNR and in single precision equal fields correlate but for 1e-10, and a move of
    # 10 µm, 2π/130 of a wavelength, turns the pilot's phase alone.
    assert alike(*frozen["echo"].values) > 1 - 1e-8
    assert alike(*frozen["uplink"].values) > 0.999
    # Redrawn heights of 0.15 mm rms: k·σ·2·cos 45° ≈ 1, most of the echo is diffuse.
    assert alike(*redrawn["echo"].values) < 0.5
    assert frozen["room"].values[0] == frozen["room"].values[1]
    assert redrawn["room"].values[0] != redrawn["room"].values[1]


def test_a_wall_that_moves_by_a_hair_keeps_its_echo(tmp_path: Path) -> None:
    moved, drawn = made(
        tmp_path,
        count=3,
        vary={"objects.wall.centre_m": SHIFTED},
        rooms={"count": 1, "moving": ["objects.wall"]},
    )
    places = drawn["objects.wall.centre_m"].values[:, 0]
    assert np.ptp(places) > 1e-7
    assert alike(moved["echo"].values[0], moved["echo"].values[2]) > 0.999
    assert len(np.unique(moved["room"].values)) == 1


def test_a_room_is_drawn_once_and_rooms_differ(tmp_path: Path) -> None:
    root, drawn = made(tmp_path, count=6, vary={**NEAR, **TURNED}, rooms={"count": 2})
    rooms = root["room"].values
    assert rooms.tolist() == [rooms[0]] * 3 + [rooms[3]] * 3
    assert rooms[0] != rooms[3]
    angles = drawn["objects.wall.angle_deg"].values
    assert len(set(angles[:3])) == len(set(angles[3:])) == 1
    assert angles[0] != angles[3]
    assert len({tuple(place) for place in drawn["users.user.position_m"].values}) == 6


def test_smooth_walls_that_do_not_vary_are_one_room(tmp_path: Path) -> None:
    smooth = {**SMALL["set"], "objects.wall.roughness.rms_mm": 0.0}
    root, _ = made(tmp_path, count=3, vary=NEAR, set=smooth)
    assert len(np.unique(root["room"].values)) == 1
    assert root["room"].values[0] >= 0


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"rooms": {"count": 4}, "count": 6}, r"rooms\.count = 4 does not divide the 6 samples"),
        ({"rooms": {"count": 0}, "count": 6}, r"rooms\.count = 0"),
        ({"rooms": {"count": 2, "moving": ["users.user"]}}, "no part of a room"),
        (
            {"rooms": {"count": 2, "moving": ["objects.walls"]}},
            r"objects\.walls.* is not varied.*give it a distribution",
        ),
        (
            {
                "rooms": {"count": 2},
                "vary": {"objects.wall.angle_deg": {"kind": "grid", "values": [44.0, 45.0]}},
            },
            r"vary\.objects\.wall\.angle_deg: a grid steps from sample to sample",
        ),
    ],
)
def test_rooms_that_cannot_be_are_refused_before_any_work(
    tmp_path: Path, changes: dict[str, Any], told: str
) -> None:
    with pytest.raises(ScenarioError, match=told):
        plan_dataset({**SMALL, "count": 4, **changes}, tmp_path / "it.zarr")


def test_a_room_that_no_draw_makes_possible_fails_with_the_reason(tmp_path: Path) -> None:
    config = {
        **SMALL,
        "count": 2,
        "attempts": 3,
        "vary": {
            "users.user.position_m": {"kind": "choice", "values": [[0.9, 0.8], [0.0, 0.0]]},
            "points.it.position_m": {"kind": "in_box", "low_m": [0.0, 0.0], "high_m": [0.0, 0.0]},
        },
        "rooms": {"count": 1},
    }
    with pytest.raises(ScenarioError, match="none of 3 draws is possible"):
        plan_dataset(config, tmp_path / "it.zarr")
