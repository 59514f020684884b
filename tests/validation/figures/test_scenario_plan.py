import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.optimize import brentq

from scenes.files.loading import load_scenario
from scenes.schema.antenna import Antenna, Cosine, GaussianBeam, Horn, Isotropic
from simulator.antennas.field_pattern import field_gain
from validation.figures.scenario_plan import draw_scenario, half_power_width, outline

ALONG_X = np.array([1.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "antenna",
    [
        GaussianBeam(kind="gaussian_beam", sigma_rad=0.1, aim_deg=0),
        Cosine(kind="cosine", exponent=3.0, aim_deg=0),
        Horn(kind="horn", gain_dbi=23.0, aim_deg=0),
    ],
)
def test_the_wedge_of_a_beam_ends_where_the_simulated_gain_has_halved(antenna: Antenna) -> None:
    def gain(angle: float) -> float:
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        return float(field_gain(antenna, ALONG_X, direction[None])[0]) ** 2

    halved = brentq(lambda angle: gain(angle) - gain(0.0) / 2, 0.0, 1.5)
    assert half_power_width(antenna) == pytest.approx(2 * halved, rel=1e-6)


def test_an_isotropic_antenna_has_no_wedge() -> None:
    assert half_power_width(Isotropic()) is None


def test_a_plate_is_drawn_from_end_to_end() -> None:
    ends = outline(load_scenario("slam_2d"), "wall")
    reach = 0.2 / np.sqrt(2)  # half of 0.40 m at 45°, about (0, 0.8)
    np.testing.assert_allclose(ends, [[-reach, 0.8 - reach, 0], [reach, 0.8 + reach, 0]])


def test_every_object_and_user_is_named_in_the_plan() -> None:
    ax = draw_scenario(Figure().subplots(), load_scenario("slam_2d"))
    named = " ".join(text.get_text() for text in ax.texts)
    assert "wall\nmetal, 0.05 mm rms" in named
    assert "user" in named
    assert "array" in named


def test_antennas_apart_are_named_and_their_beams_drawn() -> None:
    scenario = load_scenario("rcs_drywall")
    ax = draw_scenario(Figure().subplots(), scenario)
    named = [text.get_text() for text in ax.texts]
    assert "receivers" in named
    assert "transmitter" in named
    assert "array" not in named
    wedges = [patch for patch in ax.patches if isinstance(patch, Polygon)]
    tips = [patch.get_xy()[0] for patch in wedges]
    places = scenario.base_station.element_positions
    np.testing.assert_allclose(tips[0], places[len(places) // 2, :2])
    np.testing.assert_allclose(tips[1], [-0.212132034, 0.087867966])
