"""Rooms drawn at random are those that the prior's text tells."""

import numpy as np
import pytest

from scenes.files.loading import scenario_to_toml
from scenes.schema.objects import Box, Cylinder, Plate
from validation.random_rooms.prior import SETS, USER, draw_room


@pytest.mark.parametrize("kind", SETS)
def test_a_room_depends_on_its_set_its_number_and_its_purpose_alone(kind: str) -> None:
    room = scenario_to_toml(draw_room(kind, 3, purpose="tuning"))
    assert room == scenario_to_toml(draw_room(kind, 3, purpose="tuning"))
    assert room != scenario_to_toml(draw_room(kind, 4, purpose="tuning"))
    judged = scenario_to_toml(draw_room(kind, 3, purpose="judging"))
    assert room.replace("tuning", "judging") != judged


def test_plain_rooms_are_within_the_limits_that_the_prior_tells() -> None:
    rooms = [draw_room("plain", number, purpose="tuning") for number in range(40)]
    plates = [[o for o in room.objects.values() if isinstance(o, Plate)] for room in rooms]
    posts = [[o for o in room.objects.values() if isinstance(o, Cylinder)] for room in rooms]
    assert {len(some) for some in plates} == {1, 2, 3}
    assert {len(some) for some in posts} == {0, 1, 2}
    every = [plate for some in plates for plate in some]
    assert {plate.material for plate in every} == {"metal", "drywall", "glass"}
    assert all(0.08 <= plate.length_m <= 0.30 for plate in every)
    assert all(
        plate.roughness is not None and 0.02e-3 <= plate.roughness.rms <= 0.15e-3 for plate in every
    )
    places = np.array([room.users[USER].position for room in rooms])
    assert np.all(np.abs(places[:, 0]) <= 0.5)
    assert np.all((places[:, 1] >= 0.1) & (places[:, 1] <= 0.8))
    # Of 40 draws with a share of one half, 8 to 32 are within four deviations.
    beams = sum(room.users[USER].antenna.kind == "gaussian_beam" for room in rooms)
    assert 8 <= beams <= 32
    # A fifth: 0 would be 3 deviations off, once in 7500 sets.
    assert {room.max_bounces for room in rooms} == {1, 2}


def test_the_other_sets_hold_what_they_are_named_for() -> None:
    bodies = [draw_room("bodies", number, purpose="tuning") for number in range(8)]
    assert any(isinstance(one, Box) for room in bodies for one in room.objects.values())
    assert any(one.material == "absorber" for room in bodies for one in room.objects.values())
    bounces = [draw_room("bounces", number, purpose="tuning") for number in range(8)]
    assert {room.max_bounces for room in bounces} == {2, 3}
    bands = [draw_room("bands", number, purpose="tuning") for number in range(8)]
    assert all(24 <= room.radio.start_ghz < room.radio.stop_ghz <= 330 for room in bands)
    assert draw_room("space", 0, purpose="tuning").dimensions == 3


def test_an_unknown_set_is_refused() -> None:
    with pytest.raises(ValueError, match="no set of rooms 'castles'; there are plain"):
        draw_room("castles", 0, purpose="tuning")
