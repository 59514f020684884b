"""Linear polarization of antennas: axes, fields along rays, mirror images, whole links."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.scenario import ScenarioError, parse_scenario
from scenes.schema.antenna import Horn, Isotropic
from simulator.antennas.polarization import VERTICAL, Polarization, antenna_polarization
from simulator.simulation import simulate

AHEAD = np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("polarization", "axis"),
    [
        ("vertical", [0.0, 0.0, 1.0]),
        ("horizontal", [1.0, 0.0, 0.0]),  # to the right of who looks along +y
        (45.0, [np.sqrt(0.5), 0.0, np.sqrt(0.5)]),
        (-90.0, [-1.0, 0.0, 0.0]),
    ],
)
def test_the_axis_turns_to_the_right_as_seen_from_behind(
    polarization: Any, axis: list[float]
) -> None:
    antenna = Horn(kind="horn", gain_dbi=20.0, polarization=polarization)
    found = antenna_polarization(antenna, AHEAD)
    np.testing.assert_allclose(found.axis, axis, atol=1e-15)


def test_the_field_is_across_the_ray_of_unit_length_and_turned_by_its_cross_polar_part() -> None:
    rng = np.random.default_rng(1)
    rays = rng.standard_normal((20, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    plain = VERTICAL.field(rays)
    crossed = Polarization(cross_polar=0.1).field(rays)
    for field in (plain, crossed):
        np.testing.assert_allclose(np.einsum("nx,nx->n", field, rays), 0.0, atol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(field, axis=-1), 1.0, rtol=1e-14)
    turn = np.arccos(np.einsum("nx,nx->n", plain, crossed))
    np.testing.assert_allclose(turn, np.arctan(0.1), rtol=1e-10)
    ahead = Polarization(cross_polar=0.1).field(AHEAD[None])[0]
    assert ahead[0] > 0  # on the right
    np.testing.assert_array_equal(VERTICAL.field(np.array([[0.0, 0.0, 1.0]])), 0.0)


def test_the_mirror_image_of_a_field_is_the_field_of_the_mirror_image() -> None:
    rng = np.random.default_rng(2)
    normal = rng.standard_normal(3)
    normal /= np.linalg.norm(normal)
    turn = np.eye(3) - 2 * np.outer(normal, normal)
    one = Polarization(axis=np.array([0.6, 0.0, 0.8]), cross_polar=0.2)
    rays = rng.standard_normal((5, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    np.testing.assert_allclose(
        one.turned(turn).field(rays @ turn.T), one.field(rays) @ turn.T, atol=1e-14
    )


def room(station: object, user: object, dimensions: int = 3, **more: object) -> dict[str, object]:
    return {
        "format": 1, "name": "free", "dimensions": dimensions,
        "radio": {"start_ghz": 60.0, "stop_ghz": 61.0, "points": 3},
        "base_station": {"position_m": [0.0, 0.0], "elements": 2, "spacing_mm": 2.0,
                         "antenna": station},
        "users": {"ann": {"position_m": [0.0, 2.0], "antenna": user}},
        "objects": {}, **more,
    }  # fmt: skip


def pilot(station: dict[str, object], user: dict[str, object]) -> np.ndarray:
    scenario = parse_scenario(room({"kind": "isotropic", **station}, {"kind": "isotropic", **user}))
    found = simulate(scenario, seed=1).measurement.uplinks
    return np.asarray(found[0].samples)


def test_crossed_antennas_do_not_hear_each_other_but_by_their_cross_polar_part() -> None:
    both = pilot({}, {})
    level = speed_of_light / 60e9 / (4 * np.pi * 2.0)
    assert np.abs(both[0, 0]) == pytest.approx(level, rel=1e-3)
    along = pilot({"polarization": "horizontal"}, {"polarization": "horizontal"})
    # Both look along +y (the user has no aim): their axes are one.
    np.testing.assert_allclose(along, both, atol=1e-6 * level)
    crossed = pilot({}, {"polarization": "horizontal"})
    assert np.abs(crossed).max() < 1e-3 * level
    leaking = pilot({"cross_polar_db": -20.0}, {"polarization": "horizontal"})
    assert np.abs(leaking[0, 0]) == pytest.approx(0.1 / np.sqrt(1.01) * level, rel=1e-2)
    slanted = pilot({"polarization": 30.0}, {})
    assert np.abs(slanted[0, 0]) == pytest.approx(np.cos(np.pi / 6) * level, rel=1e-3)


def test_a_polarization_that_cannot_be_is_refused() -> None:
    plain = {"kind": "isotropic"}
    for antenna, message in (
        ({"polarization": "circular"}, r"ann\.antenna\.polarization = 'circular': must be 'vert"),
        ({"polarization": 270.0}, r"polarization = 270\.0: must be .* between -180 and 180"),
        ({"cross_polar_db": 3.0}, r"cross_polar_db = 3\.0: must be less than or equal to 0"),
    ):
        with pytest.raises(ScenarioError, match=message):
            parse_scenario(room(plain, {**plain, **antenna}))
    for antenna, message in (
        ({"polarization": "horizontal"}, "in two dimensions all antennas have one"),
        ({"cross_polar_db": -20.0}, "in two dimensions nothing is cross-polar"),
    ):
        with pytest.raises(ScenarioError, match=message):
            parse_scenario(room(plain, {**plain, **antenna}, dimensions=2))


def test_an_isotropic_antenna_looks_where_the_base_station_does() -> None:
    found = antenna_polarization(Isotropic(polarization="horizontal"), AHEAD)
    np.testing.assert_allclose(found.axis, [1.0, 0.0, 0.0], atol=1e-15)
