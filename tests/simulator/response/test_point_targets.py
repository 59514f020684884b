import numpy as np
import pytest
from scipy.constants import speed_of_light

from scenes.files.loading import load_scenario
from scenes.scenario import ScenarioError, parse_scenario
from simulator.response.point_targets import point_echo as point_echo_of
from simulator.scene.radio_scene import radio_scene
from simulator.simulation import simulate
from validation.analytic.point_scatterer import point_echo

SMALL = ["radio.points=21", "base_station.elements=8"]


def test_points_echo_as_the_radar_equation_says() -> None:
    scenario = load_scenario("point_scatterers", SMALL)
    echo = simulate(scenario, seed=0).measurement.echo
    assert echo is not None
    targets = list(scenario.points.values())
    expected = point_echo(
        np.stack([target.position for target in targets]),
        positions=scenario.base_station.element_positions,
        frequencies=scenario.radio.frequencies,
        radar_cross_section=np.array([target.rcs_m2 for target in targets]),
    )
    # Phases of 2e3 turns in double precision
    np.testing.assert_allclose(
        echo.samples, expected.samples, rtol=0, atol=1e-11 * np.abs(expected.samples).max()
    )


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_point_over_a_wall_is_a_point_behind_it(dimensions: int) -> None:
    """Out and back directly, over the wall one way, and over it both ways."""
    flat = dimensions == 2
    place = [0.3, 0.4] if flat else [0.3, 0.4, 0.1]
    wall = {"kind": "plate", "material": "metal", "centre_m": [0.0, 1.0], "length_m": 3.0}
    scenario = parse_scenario(
        {
            "name": "points", "dimensions": dimensions, "waves": "spherical", "max_bounces": 2,
            "radio": {"start_ghz": 9.9, "stop_ghz": 10.1, "points": 3},
            "base_station": {"elements": 2 if flat else [2, 1], "spacing_mm": 10.0},
            "objects": {"wall": wall if flat else wall | {"height_m": 3.0}},
            "points": {"ball": {"position_m": place, "rcs_m2": 0.01}},
        }
    )  # fmt: skip
    found = point_echo_of(radio_scene(scenario, seed=0, sample=0))
    array, ball = scenario.base_station.element_positions, scenario.points["ball"].position
    image = np.array([ball[0], 2.0 - ball[1], ball[2]])
    wavelengths = speed_of_light / scenario.radio.frequencies
    one_way = []
    for end, sign in ((ball, 1.0), (image, -1.0)):  # a conductor turns the field round
        lengths = np.linalg.norm(array - end, axis=-1)[:, None]
        one_way.append(sign * np.exp(-2j * np.pi * lengths / wavelengths) / lengths)
    expected = 0.1 * wavelengths / (4 * np.pi) ** 1.5 * (one_way[0] + one_way[1]) ** 2
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_a_point_behind_a_screen_is_silent() -> None:
    screen = [
        "objects.screen.kind=plate", "objects.screen.material=absorber",
        "objects.screen.length_m=2.0", "objects.screen.centre_m=[0.0, 0.6]",
    ]  # fmt: skip
    scenario = load_scenario("point_scatterers", [*SMALL, *screen])
    echo = simulate(scenario, seed=0).measurement.echo
    assert echo is not None
    near = scenario.points["near"]
    expected = point_echo(
        near.position[None],
        positions=scenario.base_station.element_positions,
        frequencies=scenario.radio.frequencies,
        radar_cross_section=np.array([near.rcs_m2]),
    )
    np.testing.assert_allclose(
        echo.samples, expected.samples, rtol=0, atol=1e-11 * np.abs(expected.samples).max()
    )


def test_exchanging_user_and_element_changes_nothing_in_a_points_link() -> None:
    def pilot(user: list[float], element: list[float]) -> np.ndarray:
        scenario = load_scenario(
            "point_scatterers",
            [
                "radio.points=5", "base_station.elements=1",
                f"base_station.position_m={element}", f"users.user.position_m={user}",
            ],
        )  # fmt: skip
        return simulate(scenario, seed=0).measurement.uplinks[0].samples

    one, other = pilot([0.3, 0.2], [0.0, 0.0]), pilot([0.0, 0.0], [0.3, 0.2])
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_a_pilot_comes_over_the_point_as_well() -> None:
    base = [*SMALL, "users.user.position_m=[0.3, 0.2]"]
    base += [f"points.{name}.rcs_m2=1e-30" for name in ("right", "left")]
    levels = [
        simulate(load_scenario("point_scatterers", [*base, f"points.near.rcs_m2={rcs}"]), seed=0)
        .measurement.uplinks[0]
        .samples
        for rcs in (1e-30, 1e-4)
    ]
    scenario = load_scenario("point_scatterers", base)
    elements, point = scenario.base_station.element_positions, np.array([0.0, 0.5, 0.0])
    lengths = np.linalg.norm(elements - point, axis=-1)
    way = float(np.hypot(0.3, 0.3))
    wavelengths = speed_of_light / scenario.radio.frequencies
    expected = wavelengths * 1e-2 / (4 * np.pi) ** 1.5 / (way * lengths[:, None])
    np.testing.assert_allclose(np.abs(levels[1] - levels[0]), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("points.near.position_m=[0.0, 0.0005]", r"points\.near\.position_m = .* from the array"),
        ("waves=cylindrical", r"waves = 'cylindrical': a point has no radar cross-section"),
        ("points.near.rcs_m2=0", r"points\.near\.rcs_m2 = 0: must be greater than 0"),
        ("points.near.position_m=[0, 1, 2]", r"points\.near\.position_m = .*: z must be 0 in two"),
        ("points.far.rcs_m2=1", r"points\.far: no such name"),
    ],
)
def test_points_that_cannot_be_are_refused(override: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario("point_scatterers", [override])
