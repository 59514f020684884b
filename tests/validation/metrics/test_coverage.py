import numpy as np
import pytest

from validation.metrics.coverage import consistency, coverage, normalised_square


def squares_of(rng: np.random.Generator, trials: int, stated: float) -> list[float]:
    """Draw errors of a covariance, and normalise them by that of a wrong deviation."""
    mixing = np.array([[1e-3, 0.0], [4e-4, 2e-4]])
    covariance = stated**2 * mixing @ mixing.T
    return [normalised_square(mixing @ rng.standard_normal(2), covariance) for _ in range(trials)]


def test_the_normalised_square_of_independent_errors_is_a_sum_of_squares() -> None:
    square = normalised_square(np.array([3e-3, 1e-3]), np.diag([1e-6, 0.25e-6]))
    assert square == pytest.approx(9.0 + 4.0)


def test_calibrated_errors_are_called_so_as_often_as_promised() -> None:
    rng = np.random.default_rng(8)
    runs = [squares_of(rng, 60, 1.0) for _ in range(300)]
    means = np.mean([consistency(run, axes=2).consistent for run in runs])
    regions = np.mean([coverage(run, probability=0.9, axes=2).consistent for run in runs])
    # 95 % of 300 runs scatter by 1.3 %; Clopper and Pearson's interval holds at least that.
    assert means == pytest.approx(0.95, abs=4 * 0.013)
    assert regions > 0.95 - 4 * 0.013


@pytest.mark.parametrize("stated", [0.6, 1.6])
def test_deviations_that_are_stated_too_small_or_too_large_are_found_out(stated: float) -> None:
    squares = squares_of(np.random.default_rng(9), 200, stated)
    found = consistency(squares, axes=2)
    assert not found.consistent
    # The mean of 200 has a deviation of 7 %; 4 of them.
    assert found.mean == pytest.approx(2 / stated**2, rel=0.28)
    assert not coverage(squares, probability=0.9, axes=2).consistent


def test_the_binomial_interval_is_the_textbook_one() -> None:
    # 9 of 10 within: Clopper and Pearson's table has 0.555 to 0.9975 at 95 %.
    found = coverage([0.0] * 9 + [1e9], probability=0.5, axes=2)
    assert found.share == pytest.approx(0.9)
    assert (found.low, found.high) == pytest.approx((0.5550, 0.9975), abs=5e-5)
    everything = coverage([0.0] * 10, probability=0.5, axes=2)
    assert (everything.low, everything.high) == pytest.approx((0.6915, 1.0), abs=5e-5)
    nothing = coverage([1e9] * 10, probability=0.5, axes=2)
    assert (nothing.low, nothing.high) == pytest.approx((0.0, 0.3085), abs=5e-5)


def test_what_cannot_be_judged_is_refused() -> None:
    with pytest.raises(ValueError, match="not positive definite"):
        normalised_square(np.zeros(3), np.diag([1.0, 1.0, 0.0]))
    with pytest.raises(ValueError, match="no trials"):
        coverage([], probability=0.9, axes=2)
    with pytest.raises(ValueError, match="no trials"):
        consistency([], axes=2)
    with pytest.raises(ValueError, match="probability = 1"):
        coverage([1.0], probability=1.0, axes=2)
    with pytest.raises(ValueError, match="confidence = 2"):
        consistency([1.0], axes=2, confidence=2.0)
