from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from validation.experiments.fig04_01_gaussian_beam import BeamPattern, draw, measure, rows


@pytest.fixture(scope="module")
def beam() -> BeamPattern:
    return measure()


def test_the_simulated_beam_is_the_corrected_equation(beam: BeamPattern) -> None:
    assert [row.name for row in rows(beam) if not row.passed] == []
    assert np.degrees(beam.half_power_width) == pytest.approx(9.540, rel=1e-3)
    # Over more than four standard widths to either side
    assert abs(beam.off_axis).max() > 4 * beam.sigma


def test_the_equation_as_printed_is_no_beam(beam: BeamPattern) -> None:
    as_printed = replace(beam, simulated=beam.printed)
    assert [row.passed for row in rows(as_printed)] == [False, True, False]


def test_the_beam_is_drawn_over_degrees(beam: BeamPattern) -> None:
    figure = Figure()
    draw(figure, beam)
    assert [ax.get_xlabel() for ax in figure.axes] == ["angle off the aim [°]"] * 2
