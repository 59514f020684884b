import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from scenes.files.loading import load_scenario
from scenes.scenario import parse_scenario
from simulator.scene.scenario_paths import scenario_paths
from validation.figures.scenario_plan import FAINT_DB, draw_scenario, path_style
from validation.figures.scenario_view import draw_view


def test_the_view_shows_every_object_user_and_path() -> None:
    scenario = load_scenario("slam_2d")
    paths = scenario_paths(scenario)
    ax = draw_view(Figure().add_subplot(projection="3d"), scenario, paths)
    assert len([part for part in ax.collections if isinstance(part, Poly3DCollection)]) == 1
    drawn = [np.array(line.get_data_3d()).T for line in ax.lines]
    for path in paths:
        assert any(np.array_equal(path.vertices, line) for line in drawn)
    assert {"wall", "  user"} <= {text.get_text() for text in ax.texts}
    assert ax.get_xlim()[0] < -0.14  # the wall's end
    assert ax.get_xlim()[1] > 1.0  # the user


def test_a_view_in_three_dimensions_has_equal_axes() -> None:
    scenario = parse_scenario(
        {
            "name": "post", "dimensions": 3,
            "radio": {"start_ghz": 20.0, "stop_ghz": 30.0, "points": 11},
            "base_station": {"elements": [4, 4], "spacing_mm": 5.0},
            "objects": {
                "post": {
                    "kind": "cylinder", "material": "glass", "centre_m": [0.0, 0.5, 0.2],
                    "radius_m": 0.1, "height_m": 0.4,
                }
            },
        }
    )  # fmt: skip
    ax = draw_view(Figure().add_subplot(projection="3d"), scenario)
    sides = np.array([np.diff(limits())[0] for limits in (ax.get_xlim, ax.get_ylim, ax.get_zlim)])
    shape = np.asarray(ax._box_aspect)  # matplotlib has no getter
    np.testing.assert_allclose(shape / shape.max(), sides / sides.max(), rtol=1e-9)


def test_a_path_that_no_antenna_looks_along_is_faint() -> None:
    direct, over = scenario_paths(load_scenario("slam_2d"))
    assert direct.gain_db < FAINT_DB < over.gain_db
    assert path_style(direct)["ls"] == ":"
    assert path_style(over)["ls"] == "-"


def test_the_plan_shows_the_paths_too() -> None:
    scenario = load_scenario("slam_2d")
    paths = scenario_paths(scenario)
    ax = draw_scenario(Figure().subplots(), scenario, paths)
    drawn = [np.asarray(line.get_xydata()) for line in ax.lines]
    for path in paths:
        assert any(np.array_equal(path.vertices[:, :2], line) for line in drawn)
