from collections.abc import Iterator
from typing import Any

import jaxtyping
import numpy as np
import pytest

from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink, frequency_step


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Switch off the check of shapes that tests run under: a user has none."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def parts(**changes: Any) -> dict[str, Any]:
    positions = np.zeros((3, 3))
    positions[:, 0] = [-1e-3, 0.0, 1e-3]
    return {
        "samples": np.ones((3, 4), dtype=np.complex128),
        "positions": positions,
        "frequencies": np.linspace(220e9, 223e9, 4),
        **changes,
    }


def changed(name: str, index: tuple[int, ...], value: complex) -> dict[str, Any]:
    values = parts()[name].copy()
    values[index] = value
    return parts(**{name: values})


REFUSED = [
    pytest.param(parts(samples=np.ones((4, 3), complex)), r"shape \(4, 3\).*must be \(3, 4\)"),
    pytest.param(
        parts(samples=np.ones((0, 4), complex), positions=np.zeros((0, 3))), "empty", id="empty"
    ),
    pytest.param(changed("samples", (0, 0), np.nan), "1 of 12 samples are NaN or infinite"),
    pytest.param(changed("samples", (1, 2), 1j * np.inf), "1 of 12 samples"),
    pytest.param(changed("positions", (1, 1), np.nan), "1 of 9 positions"),
    pytest.param(changed("frequencies", (3,), np.inf), "1 of 4 frequencies"),
    pytest.param(changed("frequencies", (3,), 219e9), "positive and increasing; sort them"),
    pytest.param(changed("frequencies", (1,), 220e9), "positive and increasing"),
    pytest.param(parts(frequencies=np.linspace(0, 3e9, 4)), "positive and increasing"),
    pytest.param(changed("positions", (2, 0), 0.0), "two positions coincide"),
    pytest.param(parts(samples=np.zeros((3, 4), complex)), "all samples are zero"),
]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(("values", "message"), REFUSED)
def test_an_array_that_no_method_could_use_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(MeasurementError, match=f"^echo: .*{message}"):
        Echo(**values)
    with pytest.raises(MeasurementError, match=f"^uplink of 'ann': .*{message}"):
        Uplink(user="ann", **values)


@pytest.mark.usefixtures("unchecked")
def test_transmitters_that_stand_apart_may_share_a_receiver() -> None:
    positions = np.zeros((3, 3))
    apart = np.array([[0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0]])
    assert Echo(**parts(positions=positions), transmit_positions=apart).samples.shape == (3, 4)
    with pytest.raises(MeasurementError, match="two positions coincide"):
        Echo(**parts(positions=positions), transmit_positions=0 * apart)
    with pytest.raises(MeasurementError, match="2 transmit positions for 3 receive positions"):
        Echo(**parts(), transmit_positions=apart[:2])
    with pytest.raises(MeasurementError, match="1 of 18 positions"):
        Echo(**parts(), transmit_positions=np.where(apart == 0.2, np.nan, apart))


def test_a_measurement_of_nothing_is_refused() -> None:
    with pytest.raises(MeasurementError, match="neither 'echo' nor 'uplink'"):
        Measurement(echo=None, uplinks=())


def test_a_measurement_is_spherical_and_looks_along_y_unless_told() -> None:
    measurement = Measurement(echo=Echo(**parts()), uplinks=())
    assert measurement.waves == "spherical"
    assert measurement.boresight.tolist() == [0, 1, 0]
    assert measurement.clock_offset is None


def test_the_step_of_a_uniform_grid_is_exact_for_any_number_of_points() -> None:
    for points in (2, 3, 1001, 5500):
        frequencies = np.linspace(220e9, 295e9, points)
        assert frequency_step(frequencies) == pytest.approx(75e9 / (points - 1), rel=1e-12)


def test_frequencies_stored_in_steps_of_a_hertz_are_uniform() -> None:
    # Rounded to 1 Hz of 75 MHz: 7e-9 of a step.
    assert frequency_step(np.round(np.linspace(220e9, 295e9, 1002))) == pytest.approx(75e9 / 1001)


def test_one_frequency_and_uneven_ones_have_no_step() -> None:
    with pytest.raises(MeasurementError, match="one point has no bandwidth"):
        frequency_step(np.array([220e9]))
    uneven = np.linspace(220e9, 295e9, 11)
    uneven[4] += 1e6
    with pytest.raises(
        MeasurementError, match=r"not uniform \(point 4 is 2\.50001e\+11 Hz, .*2\.5e\+11 Hz\); resa"
    ):
        frequency_step(uneven)
