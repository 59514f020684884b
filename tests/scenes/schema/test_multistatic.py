"""Receivers and transmitters that stand by themselves, as a scenario describes them."""

from typing import Any

import numpy as np
import pytest

from scenes.files.loading import load_scenario, scenario_schema, scenario_to_toml
from scenes.scenario import Arc, BaseStation, Scenario, ScenarioError, parse_scenario

ARC: dict[str, Any] = {
    "kind": "arc",
    "centre_m": [0.0, 0.5],
    "radius_m": 0.4,
    "start_deg": -120.0,
    "stop_deg": -60.0,
    "points": 7,
}
PLATE = {"kind": "plate", "material": "metal", "centre_m": [0.0, 0.5], "length_m": 0.1}
HORN: dict[str, Any] = {"kind": "horn", "gain_dbi": 20.0, "aim": "plate"}
AWAY: dict[str, Any] = {"position_m": [-0.3, 0.1]}


def scenario(station: dict[str, Any], **tables: Any) -> Scenario:
    return parse_scenario(
        {
            "name": "apart",
            "max_bounces": 1,
            "radio": {"start_ghz": 220.0, "stop_ghz": 222.0, "points": 3},
            "base_station": station,
            "objects": {"plate": PLATE},
            **tables,
        }
    )


def test_the_places_of_an_arc_lie_at_equal_steps_around_its_centre() -> None:
    arc = Arc(
        kind="arc", centre_m=(0.0, 0.5, 0.2), radius_m=0.4, start_deg=-180.0, stop_deg=0.0, points=3
    )
    np.testing.assert_allclose(
        arc.positions, [[-0.4, 0.5, 0.2], [0.0, 0.1, 0.2], [0.4, 0.5, 0.2]], atol=1e-15
    )


def test_receivers_look_each_for_itself_and_elements_in_parallel() -> None:
    apart = scenario({"receivers": ARC, "antenna": HORN, "transmitter": AWAY})
    places = apart.base_station.element_positions
    assert len(places) == apart.base_station.element_count == 7
    # At the arc's centre, where the plate is: against the radius.
    np.testing.assert_allclose(
        apart.element_aims(places), (apart.objects["plate"].centre - places) / 0.4, atol=1e-12
    )
    array = scenario({"elements": 3, "spacing_mm": 40.0, "antenna": HORN})
    aims = array.element_aims(array.base_station.element_positions)
    np.testing.assert_array_equal(aims, aims[[0, 0, 0]])


def test_one_transmitter_serves_all_receivers_or_each_has_its_own() -> None:
    receivers = {"kind": "list", "positions_m": [[0.0, 0.0], [0.1, 0.0], [0.0, 0.0]]}
    places = [[-0.3, 0.1], [-0.3, 0.1], [0.3, 0.1]]
    own = scenario({"receivers": receivers, "transmitter": {"positions_m": places}}).base_station
    senders = own.transmit_positions(own.element_positions)
    assert senders is not None
    np.testing.assert_array_equal(senders[:, :2], places)
    shared = scenario({"receivers": ARC, "transmitter": AWAY}).base_station
    senders = shared.transmit_positions(shared.element_positions)
    assert senders is not None
    np.testing.assert_array_equal(senders, [[-0.3, 0.1, 0.0]] * 7)


def test_the_transmitter_has_the_receivers_antenna_unless_it_has_its_own() -> None:
    assert scenario({"receivers": ARC, "antenna": HORN, "transmitter": AWAY}).base_station
    station = scenario({"receivers": ARC, "antenna": HORN, "transmitter": AWAY}).base_station
    assert station.transmit_antenna == station.antenna
    plain = {**AWAY, "antenna": {"kind": "isotropic"}}
    station = scenario({"receivers": ARC, "antenna": HORN, "transmitter": plain}).base_station
    assert station.transmit_antenna.kind == "isotropic"


THREE: dict[str, Any] = {"kind": "list", "positions_m": [[0.0, 0.0], [0.1, 0.0], [0.2, 0.0]]}


@pytest.mark.parametrize("receivers", [ARC, THREE])
def test_antennas_apart_survive_writing(receivers: dict[str, Any], tmp_path: Any) -> None:
    transmitter = {"positions_m": [[-0.3, 0.1 - 0.01 * n] for n in range(3)]}
    station = {"receivers": receivers, "transmitter": transmitter if receivers is THREE else AWAY}
    written = scenario({**station, "antenna": HORN})
    path = tmp_path / "again.toml"
    path.write_text(scenario_to_toml(written))
    assert load_scenario(str(path)) == written


def test_the_schema_asks_for_an_array_or_for_receivers() -> None:
    station = scenario_schema()["$defs"]["BaseStation"]
    assert station["anyOf"] == [
        {"required": ["elements", "spacing_mm"]},
        {"required": ["receivers"]},
    ]
    assert "transmitter" in station["properties"]
    arc = scenario_schema()["$defs"]["Arc"]
    assert set(arc["required"]) == {
        "kind", "centre_m", "radius_m", "start_deg", "stop_deg", "points"
    }  # fmt: skip


@pytest.mark.parametrize(
    ("station", "message"),
    [
        ({}, r"^base_station\.elements: missing; give the number of elements"),
        ({"elements": 3}, r"^base_station\.spacing_mm: missing; give the distance"),
        ({"receivers": ARC, "elements": 3}, r"elements = 3: base_station\.receivers say where"),
        ({"receivers": ARC, "position_m": [1.0, 0.0]}, r"position_m = .*receivers say where they"),
        (
            {"receivers": {**ARC, "stop_deg": 240.0}},
            r"receivers: from start_deg = -120\.0 to stop_deg = 240\.0 must be more than 0° and l",
        ),
        ({"receivers": {**ARC, "points": 1}}, r"receivers\.points = 1: must be greater than or eq"),
        ({"receivers": {**ARC, "kind": "ring"}}, r"receivers\.kind = 'ring': unknown kind"),
        ({"receivers": {"kind": "list", "positions_m": []}}, r"receivers\.positions_m = \[\]"),
        (
            {"receivers": {"kind": "list", "positions_m": [[0.0, 0.0], [0.0, 0.0]]}},
            r"receivers\[1\] stands where another does, with the same transmitter; move or remove",
        ),
        ({"receivers": ARC, "transmitter": {}}, r"transmitter: has neither of position_m and po"),
        (
            {"receivers": ARC, "transmitter": {"positions_m": [[0.3, 0.1], [0.4, 0.1]]}},
            r"transmitter\.positions_m has 2 places for 7 receivers; give one for each, or a sing",
        ),
        (
            {"receivers": ARC, "transmitter": AWAY, "transmit_offset_m": [0.1, 0.0]},
            r"has both transmitter and transmit_offset_m; keep one of them",
        ),
        (
            {"receivers": {**ARC, "centre_m": [0.0, 0.5, 0.1]}},
            r"receivers\.centre_m = \[0\.0, 0\.5, 0\.1\]: z must be 0 in two dimensions",
        ),
        (
            {"receivers": ARC, "transmitter": {"position_m": [-0.3, 0.1, 0.2]}},
            r"transmitter\.position_m = .*: z must be 0 in two dimensions",
        ),
        (
            {"receivers": {**ARC, "radius_m": 0.0002}},
            r"^base_station\.receivers: the antenna at .* m is .* objects\.plate; it must keep 1\.",
        ),
        (
            {"receivers": ARC, "transmitter": {"position_m": [0.01, 0.5]}},
            r"^base_station\.transmitter: the antenna at \[0\.01, 0\.5\] m is on or across objects",
        ),
        (
            {"receivers": ARC, "antenna": {**HORN, "aim": "plait"}},
            r"base_station\.antenna\.aim = 'plait': no such object \(did you mean 'plate'\?\)",
        ),
        (
            {"receivers": ARC, "transmitter": {**AWAY, "antenna": {**HORN, "aim": "x"}}},
            r"base_station\.transmitter\.antenna\.aim = 'x': no such object",
        ),
    ],
)
def test_antennas_apart_that_cannot_be_are_refused(station: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        scenario(station)


def test_users_need_an_array() -> None:
    with pytest.raises(ScenarioError, match=r"^users\.ann: a base station whose antennas stand ap"):
        scenario({"receivers": ARC}, users={"ann": {"position_m": [1.0, 1.0]}})


@pytest.mark.parametrize("dimensions", [2, 3])
def test_antennas_apart_take_one_bounce(dimensions: int) -> None:
    objects = {"plate": {**PLATE, **({"height_m": 0.1} if dimensions == 3 else {})}}
    with pytest.raises(ScenarioError, match=r"^max_bounces = 2: with transmitter and receiver ap"):
        scenario({"receivers": ARC}, dimensions=dimensions, objects=objects, max_bounces=2)


def test_the_centre_is_the_arrays_or_the_mean_of_the_receivers() -> None:
    array = BaseStation(elements=3, spacing_mm=1.0, position_m=(0.1, 0.2, 0.0))
    np.testing.assert_array_equal(array.centre, [0.1, 0.2, 0.0])
    apart = scenario({"receivers": THREE}).base_station
    np.testing.assert_allclose(apart.centre, [0.1, 0.0, 0.0], atol=1e-15)
