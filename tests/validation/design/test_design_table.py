import numpy as np
import pytest

from estimator.measurement.model import MeasurementError
from validation.design.design_table import design_table


def test_the_slam_scene_has_the_figures_of_the_design() -> None:
    rows = design_table(
        start=220e9, stop=295e9, points=1001, aperture_length=0.1295, elements=260, distance=1.8
    )
    values = {row.name: row.value for row in rows}
    assert values["cross-range cell, uplink"] == pytest.approx(14.3, abs=0.05)
    assert values["range cell, echo"] == pytest.approx(0.886 * 2.0, rel=0.001)
    assert values["unambiguous range, echo"] == pytest.approx(1.999, abs=1e-3)
    assert values["unambiguous angle, echo"] == pytest.approx(30.5, abs=0.1)
    assert values["at 1.8 m"] == "radiating near field"
    # What does not fit is said where it is.
    notes = {
        row.name: row.note
        for row in design_table(
            start=220e9,
            stop=295e9,
            points=101,
            aperture_length=0.1295,
            elements=260,
            distance=1.8,
            angle=np.radians(45),
        )
    }
    assert notes["unambiguous range, echo"] == "too short for 1.8 m"
    assert notes["unambiguous angle, echo"] == "too narrow for 45°"


def test_an_impossible_radio_is_refused() -> None:
    with pytest.raises(MeasurementError, match="start must be positive and below"):
        design_table(start=3e9, stop=2e9, points=11, aperture_length=0.1, elements=9, distance=1.0)
    with pytest.raises(MeasurementError, match="points is 1"):
        design_table(start=2e9, stop=3e9, points=1, aperture_length=0.1, elements=9, distance=1.0)
