from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.localization.medium import as_in_vacuum, medium_notes
from estimator.localization.pipeline import locate
from estimator.measurement.air import Air
from estimator.measurement.model import Measurement, MeasurementError, Uplink

USER = np.array([0.4, 1.5, 0.0])
AIR = Air(temperature_c=30.0, humidity_percent=80.0)


def pilot(index: float, *, offset: float = 0.0) -> Measurement:
    positions = np.zeros((64, 3))
    positions[:, 0] = 0.5e-3 * (np.arange(64) - 31.5)
    frequencies = np.linspace(220e9, 230e9, 101)
    lengths = np.linalg.norm(USER - positions, axis=-1)[:, None]
    late = index * lengths / speed_of_light - offset
    samples = np.exp(-2j * np.pi * frequencies * late) / lengths
    return Measurement(
        echo=None,
        uplinks=(
            Uplink(samples=samples, positions=positions, frequencies=frequencies, user="ann"),
        ),
        clock_offset=offset,
    )


def place(measurement: Measurement) -> np.ndarray:
    (user,) = locate(measurement, images=False).users
    assert user.position is not None
    return user.position


@pytest.mark.parametrize("offset", [0.0, 2e-9])
def test_a_user_in_air_is_where_it_is_if_the_air_is_told(offset: float) -> None:
    measured = pilot(AIR.refractive_index, offset=offset)
    found = place(replace(measured, air=AIR))
    np.testing.assert_allclose(found, USER, atol=2e-6)
    # Taken for vacuum, its distance is too long by the refractivity: 379 ppm of 1.55 m.
    wrong = np.linalg.norm(place(measured)) / np.linalg.norm(USER) - 1
    assert 1e6 * wrong == pytest.approx(AIR.refractivity, abs=2.0)


def test_a_medium_of_another_index_is_told_by_it() -> None:
    measured = replace(pilot(1.5, offset=1e-9), medium_index=1.5)
    np.testing.assert_allclose(place(measured), USER, atol=2e-6)


def test_vacuum_is_left_as_it_is() -> None:
    measured = pilot(1.0)
    assert as_in_vacuum(measured) is measured


def test_what_an_untold_air_costs_is_noted_of_measured_data_only() -> None:
    measured = pilot(1.0)
    (note,) = medium_notes(measured, locate(measured, images=False).users)
    assert "319 ppm (0.496 mm of 1.55 m)" in note
    assert medium_notes(replace(measured, seed=1), ()) == ()
    (note,) = medium_notes(replace(measured, air=Air()), ())
    assert "10 K more would change them by 27 ppm, 50 % of humidity by 51 ppm" in note


def test_air_and_another_medium_together_are_refused() -> None:
    with pytest.raises(MeasurementError, match="waves run in one medium"):
        replace(pilot(1.0), air=Air(), medium_index=1.5)
    with pytest.raises(MeasurementError, match=r"medium_index = 0\.5; .* between 1 and 20"):
        replace(pilot(1.0), medium_index=0.5)
