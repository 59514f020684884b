"""Estimator and simulator on ideal points, against closed form."""

from dataclasses import replace

import pytest
from matplotlib.figure import Figure

from validation.experiments.simulator_on_points import PointResults, draw, measure, rows


@pytest.fixture(scope="module")
def results() -> PointResults:
    return measure()


def test_points_are_imaged_and_simulated_as_closed_form_says(results: PointResults) -> None:
    assert [row.name for row in rows(results) if not row.passed] == []
    assert {image.case for image in results.images} == {
        "line, cylindrical", "line, spherical", "plane, spherical",
    }  # fmt: skip
    assert len(results.channels) == 5


def test_a_point_beside_its_place_and_a_channel_of_the_wrong_phase_fail(
    results: PointResults,
) -> None:
    moved = replace(results.images[0], cells_off=0.06, phase_error=0.1)
    turned = replace(results.channels[0], error=2.0)
    wrong = PointResults(
        images=(moved, *results.images[1:]), channels=(turned, *results.channels[1:])
    )
    failed = [row.name for row in rows(wrong) if not row.passed]
    assert len(failed) == 3
    assert failed[-1] == "simulated echo, line, spherical waves"


def test_the_cuts_are_drawn_over_cells(results: PointResults) -> None:
    figure = Figure()
    draw(figure, results)
    assert figure.axes[0].get_xlabel() == "from the point, over the -3 dB cell [-]"
