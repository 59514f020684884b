import numpy as np
import pytest

from scenes.files.loading import load_scenario
from scenes.scenario import Scenario
from simulator.simulation import simulate
from validation.baselines.room import Anchor, Room
from validation.baselines.single_array import single_array
from validation.baselines.tdoa import tdoa
from validation.baselines.toa_trilateration import toa_trilateration

SMALL = (
    "base_station.elements=64",
    "radio.points=251",
    "objects.wall.centre_m=[0.0, 0.4]",
    "objects.wall.length_m=0.2",
)


def scene(name: str, x: float, y: float, *more: str) -> Scenario:
    return load_scenario(name, (*SMALL, f"users.user.position_m=[{x}, {y}]", *more))


def test_our_own_array_hears_what_our_measurement_holds() -> None:
    quiet = scene("los_and_nlos_user", 0.25, 0.37, "noise.snr_db=inf", "radio.points=51")
    room = Room(quiet, seed=3)
    (uplink,) = simulate(quiet, seed=3).measurement.uplinks
    pilot = room.pilot(room.own_array)
    np.testing.assert_allclose(pilot.positions, uplink.positions, atol=1e-12)
    # The positions' last bits turn the phases: 1e-16 m by k, and what finufft sums, 1e-9.
    scale = np.abs(uplink.samples).max()
    np.testing.assert_allclose(pilot.samples / scale, uplink.samples / scale, atol=1e-7)


def test_an_anchor_and_the_user_hear_each_other_alike() -> None:
    quiet = scene("los_and_nlos_user", 0.25, 0.37, "noise.snr_db=inf", "radio.points=51")
    room = Room(quiet, seed=1)
    anchor = Anchor(x=0.05, y=0.0)
    up = room.pilot(anchor).samples
    down = room.pilot_at_user(anchor, elements=1, turn=0.2).samples
    # Reciprocity of the facets' symmetric form, to finufft's tolerance.
    np.testing.assert_allclose(down / np.abs(up).max(), up / np.abs(up).max(), atol=1e-4)


def test_every_receiver_in_our_band_has_our_noise() -> None:
    loud = scene("los_user", 0.1, 0.2, "noise.snr_db=0.0")
    quiet = scene("los_user", 0.1, 0.2, "noise.snr_db=inf")
    rooms = [Room(one, seed=0) for one in (loud, quiet)]
    levels = []
    for anchor in (Anchor(x=0.0, y=0.0, elements=4), Anchor(x=0.6, y=-0.6, elements=4)):
        noisy, clean = (room.pilot(anchor).samples for room in rooms)
        levels.append(float(np.mean(np.abs(noisy - clean) ** 2)))
    # Means of 1004 exponential values scatter by 3 %: 4 deviations of their ratio.
    assert levels[1] / levels[0] == pytest.approx(1.0, abs=0.18)
    ours = rooms[1].pilot(rooms[1].own_array).samples
    assert levels[0] == pytest.approx(float(np.mean(np.abs(ours) ** 2)), rel=0.18)


def test_in_sight_times_of_arrival_find_the_user() -> None:
    room = Room(scene("los_user", 0.1, 0.2), seed=0)
    for method, most in ((toa_trilateration, 1e-4), (single_array, 1e-5), (tdoa, 1e-3)):
        position = method(room).position
        assert position is not None
        # c/2πB of a single antenna's 251 points at 20 dB is 2 µm in 0.2 m: a factor by geometry.
        assert np.linalg.norm(position - [0.1, 0.2]) < most


def test_over_a_wall_they_find_its_image() -> None:
    room = Room(scene("slam_2d", 0.45, 0.4), seed=0)
    position = single_array(room).position
    assert position is not None
    # The image in y = x + 0.4; the wall's roughness bends the wave by some 0.3 mm.
    assert np.linalg.norm(position - [0.0, 0.85]) < 2e-3


def test_rooms_in_space_are_refused() -> None:
    with pytest.raises(ValueError, match="the other methods are for two and one"):
        Room(load_scenario("room_3d"), seed=0)
