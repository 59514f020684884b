import numpy as np
import pytest
from scipy import stats

from estimator.compute.distributions import (
    chi_square_quantile,
    chi_square_tail,
    f_quantile,
    normal_density,
    normal_limit,
    poisson_tail,
)

ROUNDING = 1e-12  # relative: scipy.stats calls the same functions of scipy.special


@pytest.mark.parametrize("freedom", [1, 2, 3, 40])
@pytest.mark.parametrize("probability", [0.5, 0.95, 1 - 1e-9])
def test_quantiles_and_tails_of_chi_square_are_those_of_scipy_stats(
    probability: float, freedom: int
) -> None:
    limit = chi_square_quantile(probability, freedom)
    assert limit == pytest.approx(stats.chi2.ppf(probability, freedom), rel=ROUNDING)
    assert chi_square_tail(limit, freedom) == pytest.approx(
        stats.chi2.sf(limit, freedom), rel=ROUNDING
    )


@pytest.mark.parametrize("lower", [2, 7, 100])
def test_quantiles_of_f_are_those_of_scipy_stats(lower: int) -> None:
    assert f_quantile(0.95, 2, lower) == pytest.approx(stats.f.ppf(0.95, 2, lower), rel=ROUNDING)


@pytest.mark.parametrize("count", [-1.0, 0.0, 3.5, 20.0])
def test_tails_of_poisson_are_those_of_scipy_stats(count: float) -> None:
    assert poisson_tail(count, 4.2) == pytest.approx(stats.poisson.sf(count, 4.2), rel=ROUNDING)


def test_normal_densities_and_limits_are_those_of_scipy_stats() -> None:
    values = np.linspace(-5.0, 5.0, 11)
    density = normal_density(values, 0.3, 2.0)
    np.testing.assert_allclose(density, stats.norm.pdf(values, 0.3, 2.0), rtol=ROUNDING)
    for probability in (0.5, 1e-3, 1e-9):
        assert normal_limit(probability) == pytest.approx(
            stats.norm.isf(probability), rel=ROUNDING, abs=1e-15
        )
