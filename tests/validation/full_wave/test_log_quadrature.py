"""The trapezoidal rule over a logarithm, against closed forms."""

import numpy as np
import pytest
from scipy.special import zeta

from validation.full_wave.log_quadrature import BAND, REACH, log_weights, missing_logarithm


def integral(turns: int, count: int) -> float:
    """Integrate cos(mθ) ln(4 sin²(θ/2)) over the circle, the singularity on a grid point."""
    step = 2 * np.pi / count
    angles = step * np.arange(count)
    wave = np.cos(turns * angles)
    logarithm = np.zeros(count)
    logarithm[1:] = np.log(4 * np.sin(angles[1:] / 2) ** 2)
    weights = log_weights()
    near = weights[0] + 2 * np.sum(weights[1:] * np.cos(turns * step * np.arange(1, REACH + 1)))
    return float(step * np.sum(wave * logarithm) + 2 * step * (np.log(step) + near))


@pytest.mark.parametrize("turns", [1, 5, 12, 20, 38])
def test_waves_over_a_logarithm_integrate_to_the_closed_form(turns: int) -> None:
    # ∫ cos(mθ) ln(4 sin²(θ/2)) dθ = −2π/m; 38 of 100 points are the band's edge.
    assert 2 * np.pi * turns / 100 < BAND
    # The fit errs by 8e-8 in the rule's unit, two steps of 2π/100 here.
    assert integral(turns, 100) == pytest.approx(-2 * np.pi / turns, abs=8e-8 * 4 * np.pi / 100)


def test_beyond_its_band_the_rule_fails() -> None:
    assert abs(integral(46, 100) + 2 * np.pi / 46) > 1e-5


def test_what_the_rule_misses_has_the_series_of_the_zeta_correction() -> None:
    phase = np.linspace(0, 1.0, 5)
    orders = np.arange(1, 30)
    series = zeta(2 * orders + 1) * (phase[:, None] / (2 * np.pi)) ** (2 * orders)
    expected = -np.log(2 * np.pi) + series.sum(axis=1)
    np.testing.assert_allclose(missing_logarithm(phase), expected, atol=1e-13)


@pytest.mark.parametrize(("reach", "band"), [(0, 2.0), (5, 3.2), (5, 0.0)])
def test_a_band_that_the_grid_cannot_carry_is_refused(reach: int, band: float) -> None:
    with pytest.raises(ValueError, match="take a finer grid"):
        log_weights(reach=reach, band=band)
