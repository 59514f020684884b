import numpy as np
import pytest

from estimator.measurement import air as measured
from scenes.schema.air import Air
from simulator.materials import gas_absorption
from simulator.materials.gas_absorption import (
    attenuation_db_km,
    line_refractivity,
    refractive_index,
)

ROOM = Air()


def test_absorption_is_that_of_the_validation_examples_of_the_itu(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Study Group 3's validation examples of P.676: dry air of 1013.25 hPa and 7.5 g/m³ of vapour
    # at 15 °C; oxygen and vapour [dB/km], to the digits that are published.
    kelvin = 288.15
    vapour = 7.5 * kelvin / 216.7
    monkeypatch.setattr(gas_absorption, "vapour_pressure", lambda air: vapour)
    air = Air(temperature_c=15.0, pressure_hpa=1013.25 + vapour)
    ghz = np.array([12.0, 20.0, 60.0, 90.0, 130.0])
    oxygen = np.array([0.00869826, 0.01188355, 14.62347480, 0.03886971, 0.04150908])
    water = np.array([0.00953539, 0.09704730, 0.15484184, 0.34197339, 0.75184470])
    np.testing.assert_allclose(attenuation_db_km(air, 1e9 * ghz), oxygen + water, atol=2e-8)


@pytest.mark.parametrize("celsius", [-10.0, 20.0, 40.0])
@pytest.mark.parametrize("humidity", [0.0, 50.0, 100.0])
def test_two_forms_of_the_refractivity_agree(celsius: float, humidity: float) -> None:
    two = Air(temperature_c=celsius, humidity_percent=humidity)
    three = measured.Air(temperature_c=celsius, humidity_percent=humidity)
    # P.453-14 says 0.02 % from -50 to +40 °C.
    refractivity = 1e6 * (refractive_index(two) - 1)
    assert refractivity == pytest.approx(three.refractivity, rel=2e-4)


def test_vacuum_has_the_index_1() -> None:
    assert refractive_index(None) == 1.0


def test_lines_delay_as_their_absorption_says() -> None:
    # Kramers and Kronig: the real part is the Hilbert transform of the imaginary one, here of the
    # 60 GHz band and the 325 GHz line, against the mean of both sides.
    ghz = np.arange(0.25, 2000.0, 0.5)
    dry = Air(humidity_percent=0.0, pressure_hpa=1013.25)
    imaginary = gas_absorption._lines(dry, ghz).imag
    at = np.array([40.0, 80.0, 130.0])  # between the samples
    square = ghz[None] ** 2 - at[:, None] ** 2
    wanted = 2 / np.pi * (0.5 * ghz * imaginary / square).sum(axis=1)
    constant = 2 / np.pi * (0.5 * imaginary / ghz).sum()
    found = line_refractivity(dry, 1e9 * at)
    # The sum begins at 0.25 GHz and is Riemann's: some per cent.
    np.testing.assert_allclose(found, wanted - constant, rtol=0.05, atol=0.01)
