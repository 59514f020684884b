import pytest

from estimator.measurement.air import Air
from estimator.measurement.errors import MeasurementError


def test_dry_air_of_0_degrees_has_the_refractivity_that_was_measured() -> None:
    # Smith and Weintraub 1953: 77.6 K/hPa is the mean of measurements; Boudouris 1963 measured
    # 288.0 ± 0.2 ppm at 0 °C and 1013.25 hPa, without CO2.
    dry = Air(temperature_c=0.0, humidity_percent=0.0)
    assert dry.refractivity == pytest.approx(288.0, abs=0.3)


def test_water_vapour_saturates_at_what_steam_tables_give() -> None:
    # Over water without air, IAPWS: 12.28, 23.39, 42.47 hPa; air raises it by 0.4 %.
    for celsius, pressure in ((10.0, 12.28), (20.0, 23.39), (30.0, 42.47)):
        found = Air(temperature_c=celsius, humidity_percent=100.0).vapour_pressure
        assert found == pytest.approx(1.004 * pressure, rel=2e-3)


def test_air_in_kelvin_is_refused() -> None:
    with pytest.raises(MeasurementError, match=r"temperature_c = 293.*another unit"):
        Air(temperature_c=293.0)
