r"""Range profiles of point scatterers at a sweep's own range bins, and their slopes.

A point at range r has, at the bins :math:`r_b = b c / 2 N \Delta f` of N frequencies about
:math:`f_c`, the profile

.. math:: \frac{1}{\sqrt N} \sum_n e^{-j 4 \pi (f_n - f_c) (r - r_b) / c}\, e^{-j 4 \pi f_c r / c}
          = \frac{D(r_b - r)}{\sqrt N}\, e^{-j 4 \pi f_c r / c} ,
          \qquad D = \frac{\sin(N x)}{\sin x}, \; x = 2 \pi \Delta f\, (r_b - r) / c .
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.compute import engine
from estimator.compute.integer_division import row_and_column

ON_BIN = 1e-7
"""Least sin x that is divided by: nearer to a bin its kernel is N, and flat. [-]"""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Uniform frequencies."""

    centre: float  # [Hz]
    step: float  # [Hz]
    count: int

    @property
    def bin_width(self) -> float:
        """Distance of independent ranges, c/2NΔf. [m]."""
        return speed_of_light / (2 * self.count * self.step)


def point_profiles(
    sweep: Sweep, bins: Float[np.ndarray, " bins"], ranges: Float[np.ndarray, "positions points"]
) -> Complex[np.ndarray, "rows points"]:
    """Return the profile of each point.

    Parameters
    ----------
    sweep
        The frequencies.
    bins
        Ranges of the profiles: whole multiples of the sweep's bin width. [m]
    ranges
        From each antenna position to each point. [m]

    Returns
    -------
    Profiles, rows being positions and, within each, bins. [-]
    """
    return _tables(ranges, bins, _traced(sweep, bins, ranges, None)[:1])[0]


def point_slopes(
    sweep: Sweep,
    bins: Float[np.ndarray, " bins"],
    ranges: Float[np.ndarray, "positions points"],
    rates: Float[np.ndarray, "positions points"],
) -> Complex[np.ndarray, "rows points"]:
    """Return how the profiles of :func:`point_profiles` change as the points move.

    Parameters
    ----------
    sweep, bins, ranges
        As there.
    rates
        By how much ranges grow with what moves the points. [-]

    Returns
    -------
    Derivatives of the profiles. [1/m]
    """
    return _tables(ranges, bins, _traced(sweep, bins, ranges, rates)[1:])[0]


def profiles_and_slopes(
    sweep: Sweep,
    bins: Float[np.ndarray, " bins"],
    ranges: Float[np.ndarray, "positions points"],
    rates: Float[np.ndarray, "positions points"],
) -> tuple[Complex[np.ndarray, "rows points"], Complex[np.ndarray, "rows points"]]:
    """Return both, in one pass: see :func:`point_profiles` and :func:`point_slopes`."""
    profiles, slopes = _tables(ranges, bins, _traced(sweep, bins, ranges, rates))
    return profiles, slopes


def _tables(
    ranges: Float[np.ndarray, "positions points"],
    bins: Float[np.ndarray, " bins"],
    values: list[Any],
) -> list[Complex[np.ndarray, "rows points"]]:
    dr.eval(values)  # together: one kernel
    shape = len(ranges) * bins.size, ranges.shape[1]
    return [value.numpy().view(np.complex128).reshape(shape) for value in values]


def _traced(
    sweep: Sweep,
    bins: Float[np.ndarray, " bins"],
    ranges: Float[np.ndarray, "positions points"],
    rates: Float[np.ndarray, "positions points"] | None,
) -> list[Any]:
    """Trace the profiles and, if rates are given, their slopes; nothing is evaluated yet.

    Real and imaginary parts are lanes of their own, side by side as numpy holds them.
    """
    arrays = engine.arrays()
    positions, points = ranges.shape
    per_range = 2 * np.pi * sweep.step / speed_of_light
    wavenumber = 4 * np.pi * sweep.centre / speed_of_light
    # Bins are π/N apart in x: sin(Nx) of all bins is that of one, but for the sign.
    turn = np.exp(1j * sweep.count * per_range * ranges)
    carrier = np.exp(-1j * wavenumber * ranges) / np.sqrt(sweep.count)
    sign = np.cos(sweep.count * per_range * bins)
    # The sine of a difference from those of both sides: exact to 1e-16, on a bin to 1e-9 of 1.
    at_point, at_bin = np.exp(1j * per_range * ranges), np.exp(1j * per_range * bins)
    of_bin = [arrays.Float64(table) for table in (at_bin.real, at_bin.imag, sign)]

    lane = dr.arange(arrays.UInt32, 2 * positions * bins.size * points)
    row, part = row_and_column(lane, 2 * points)
    position, column = row_and_column(row, bins.size)
    entry = position * dr.opaque(arrays.UInt32, 2 * points) + part

    def of_point(table: np.ndarray) -> Any:
        return dr.gather(arrays.Float64, arrays.Float64(table.ravel()), entry)

    cosine_p, sine_p, cosine_n, sine_n = (
        of_point(np.repeat(table, 2, axis=1))
        for table in (at_point.real, at_point.imag, turn.real, turn.imag)
    )
    carried = of_point(carrier.view(np.float64))
    cosine_b, sine_b, turned = (dr.gather(arrays.Float64, table, column) for table in of_bin)

    def opaque(value: float) -> Any:
        return dr.opaque(arrays.Float64, value)

    scale, count = opaque(per_range), opaque(float(sweep.count))
    sine = dr.fma(sine_b, cosine_p, -cosine_b * sine_p)
    cosine = dr.fma(cosine_b, cosine_p, sine_b * sine_p)
    on_bin = abs(sine) < ON_BIN
    inverse = 1 / dr.select(on_bin, 1.0, sine)
    kernel = dr.select(on_bin, count, -turned * sine_n * inverse)
    profiles = kernel * carried
    if rates is None:
        return [profiles]
    falling = (turned * cosine_n * count - kernel * cosine) * inverse * scale
    rate = of_point(np.repeat(rates.astype(np.float64), 2, axis=1))
    real = dr.select(on_bin, 0.0, -falling) * rate
    imag = -opaque(wavenumber) * kernel * rate
    return [profiles, real * carried + imag * of_point((1j * carrier).view(np.float64))]
