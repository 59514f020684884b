r"""Air as the medium that waves run in: its refractive index, after Recommendation ITU-R P.453-14.

With :math:`P` the pressure and :math:`e` the water vapour's [hPa], :math:`T` in kelvin, the
refractivity is (dry and wet terms)

.. math:: N = 10^6 (n - 1) = 77.6 \frac{P - e}{T} + 72 \frac{e}{T} + 3.75 \cdot 10^5 \frac{e}{T^2}

It does not depend on frequency. What the lines of oxygen and water vapour add is left out: 0.7 to
2.6 ppm between 220 and 330 GHz in air of 20 °C and 50 % (P.676).
"""

import math
from dataclasses import dataclass

from estimator.measurement.errors import MeasurementError

LIMITS = {
    "temperature_c": (-80.0, 100.0),
    "pressure_hpa": (1.0, 2000.0),
    "humidity_percent": (0.0, 100.0),
}
"""Smallest and largest value of each quantity: P.453's formulas hold over water to 50 °C, and a
value in another unit (kelvin, pascal, kPa) is beyond. [°C], [hPa], [%]"""


@dataclass(frozen=True, kw_only=True)
class Air:
    """Air of a temperature, a pressure and a relative humidity.

    Examples
    --------
    >>> round(1e6 * (Air().refractive_index - 1), 1)  # of a room [ppm]
    319.2
    """

    temperature_c: float = 20.0
    pressure_hpa: float = 1013.25
    humidity_percent: float = 50.0

    def __post_init__(self) -> None:
        """Refuse what is no air that anybody measures in, such as kelvin."""
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise MeasurementError(
                    f"air: {name} = {value:g}; it must lie between {low:g} and {high:g}: is it in "
                    "another unit?"
                )

    @property
    def vapour_pressure(self) -> float:
        """Partial pressure of the water vapour, P.453-14, section 1. [hPa]."""
        t = self.temperature_c
        enhancement = 1 + 1e-4 * (7.2 + self.pressure_hpa * (0.0320 + 5.9e-6 * t * t))
        saturated = enhancement * 6.1121 * math.exp((18.678 - t / 234.5) * t / (t + 257.14))
        return min(self.humidity_percent / 100 * saturated, self.pressure_hpa)

    @property
    def refractivity(self) -> float:
        """N, (n - 1) in parts per million. [ppm]."""
        kelvin, vapour = self.temperature_c + 273.15, self.vapour_pressure
        dry = 77.6 * (self.pressure_hpa - vapour) / kelvin
        return dry + 72 * vapour / kelvin + 3.75e5 * vapour / kelvin**2

    @property
    def refractive_index(self) -> float:
        """The speed of light in vacuum over that in this air. [-]."""
        return 1 + 1e-6 * self.refractivity

    def __str__(self) -> str:
        """Say what it is, with units."""
        return (
            f"{self.temperature_c:g} °C, {self.pressure_hpa:g} hPa, "
            f"{self.humidity_percent:g} % humidity"
        )


ROOM = Air()
"""Air of a room, where nothing is told: 20 °C, 1013.25 hPa, 50 %."""
