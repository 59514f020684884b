"""Figures 4.9 to 4.12 and 4.14 to 4.17: a user that is seen only over walls."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from scenes.files.loading import load_scenario
from validation.analytic.point_scatterer import point_uplink
from validation.experiments import fig04_09_slam_2d, fig04_14_lab_two_walls
from validation.experiments.fig04_09_slam_2d import Slam2d
from validation.trials.hidden_user import UserTrial, hidden_user, map_cuts


@pytest.fixture(scope="module")
def slam() -> Slam2d:
    return fig04_09_slam_2d.measure(seeds=1, quick=True)


def failed(result: Slam2d) -> list[str]:
    return [row.name.split(",")[0] for row in fig04_09_slam_2d.rows(result) if not row.passed]


def test_the_map_of_a_point_is_as_wide_as_theory_says() -> None:
    positions = np.zeros((130, 3))
    positions[:, 0] = (np.arange(130) - 64.5) * 0.5e-3
    place = np.array([[0.3, 1.0, 0.0]])
    uplink = point_uplink(place, positions=positions, frequencies=np.linspace(220e9, 295e9, 501))
    aoa, length = float(np.arctan2(1.0, 0.3)), float(np.hypot(1.0, 0.3))
    # A hundredth of each width off the peak
    cuts = map_cuts(uplink, aoa=aoa + 1e-4, path_length=length + 3e-5)
    # a step of 0.01 widths, and the parabola's and the lines' interpolation
    assert abs(cuts.angle.place - aoa) < 0.01 * cuts.theory_angle
    assert abs(cuts.length.place - length) < 0.02 * cuts.theory_length
    # the formulas' narrow band and small aperture
    assert cuts.angle.width == pytest.approx(cuts.theory_angle, rel=0.02)
    assert cuts.length.width == pytest.approx(cuts.theory_length, rel=0.02)


def test_a_user_over_a_wall_keeps_the_claims_at_half_size(slam: Slam2d) -> None:
    assert failed(slam) == []
    (trial,) = slam.trials
    # 0.4 m to the wall and 0.5 m beyond, straight ahead of the array
    assert trial.true_length == pytest.approx(0.9, abs=1e-9)
    assert trial.true_aoa == pytest.approx(np.pi / 2, abs=1e-9)


def test_a_user_that_is_not_found_and_a_wall_that_is_missed_fail(slam: Slam2d) -> None:
    lost = replace(slam.trials[0], status="not_found", error=None, walls=(None,))
    assert failed(replace(slam, trials=(lost,))) == [
        "angle of wall 1", "offset of wall 1", "median error of the user",
        "worst error of the user",
    ]  # fmt: skip


def test_a_map_twice_as_wide_fails(slam: Slam2d) -> None:
    trial = slam.trials[0]
    angle = replace(trial.cuts.angle, width=2 * trial.cuts.angle.width)
    wide = replace(trial, cuts=replace(trial.cuts, angle=angle))
    assert failed(replace(slam, trials=(wide,))) == ["-3 dB width of the map across range"]


def test_the_figure_has_metres_degrees_and_decibels(slam: Slam2d) -> None:
    figure = Figure()
    fig04_09_slam_2d.draw(figure, slam)
    labels = {ax.get_xlabel() for ax in figure.axes}
    assert {"angle of arrival [°]", "x, along the array [m]", "position error [mm]"} <= labels
    numbers = replace(slam, trials=(replace(slam.trials[0], seen=None),))
    with pytest.raises(RuntimeError, match="were not kept"):
        fig04_09_slam_2d.draw(Figure(), numbers)


@pytest.mark.slow
def test_three_realisations_keep_the_claims_at_half_size() -> None:
    assert failed(fig04_09_slam_2d.measure(quick=True)) == []


@pytest.fixture(scope="module")
def lab() -> UserTrial:
    scenario = load_scenario(
        "lab_two_walls",
        (
            "base_station.elements=130",
            "radio.points=1375",
            "radio.stop_ghz=329.92",
            "objects.drywall_1.centre_m=[0.0, 0.4]",
            "objects.drywall_1.length_m=0.2",
            "objects.drywall_2.centre_m=[0.45, 0.4]",
            "objects.drywall_2.length_m=0.15",
            "objects.absorber.centre_m=[0.2, 0.1]",
            "objects.absorber.length_m=0.4",
            "users.user.position_m=[0.45, -0.14]",
        ),
    )
    return hidden_user(scenario, seed=0, walls=fig04_14_lab_two_walls.WALLS)


@pytest.mark.slow
def test_the_second_wall_is_seen_behind_the_first_and_is_unfolded(lab: UserTrial) -> None:
    scenario = load_scenario("lab_two_walls")
    result = fig04_14_lab_two_walls.LabTwoWalls(scenario=scenario, trials=(lab,))
    # At half the size the array resolves the second wall's angle half as well.
    other = {"angle of wall 2, unfolded, one realisation"}
    table = fig04_14_lab_two_walls.rows(result)
    assert {row.name for row in table if not row.passed} <= other
    figure = Figure()
    fig04_14_lab_two_walls.draw(figure, result)
    assert figure.axes[0].get_xlabel() == "x, along the array [m]"
