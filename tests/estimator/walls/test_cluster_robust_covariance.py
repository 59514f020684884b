"""The covariance of a line from its parts' pushes, against lines fitted to drawn data."""

from collections.abc import Callable

import numpy as np
import pytest

from estimator.walls.cluster_robust_covariance import cluster_robust_covariance

PLACES = np.linspace(-0.1, 0.1, 241)
DESIGNS = np.stack([np.ones_like(PLACES), 10 * PLACES], axis=-1)
PART = 0.2 / 12
TRIALS = 3000

EVEN = np.ones_like(PLACES)
GLINTS = EVEN + 200 * np.exp(-(((PLACES - 0.06) / 0.004) ** 2))
GLINTS += 60 * np.exp(-(((PLACES + 0.03) / 0.003) ** 2))


def drawn(
    weights: np.ndarray, error: Callable[[np.random.Generator], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Fit offset and tilt to drawn data, many times; return their errors and covariances."""
    rng = np.random.default_rng(1)
    gains = weights[:, None] * DESIGNS
    errors, covariances = [], []
    for _ in range(TRIALS):
        data = error(rng)
        found = np.linalg.solve(DESIGNS.T @ gains, gains.T @ data)
        scores = weights * (data - DESIGNS @ found)
        errors.append(found)
        covariances.append(cluster_robust_covariance(PLACES, DESIGNS, scores, gains, part=PART))
    return np.array(errors), np.array(covariances)


@pytest.mark.parametrize("weights", [EVEN, GLINTS], ids=["even wall", "two glints"])
def test_independent_pushes_give_the_covariance_of_least_squares(weights: np.ndarray) -> None:
    # In closed form (Xᵀ W X)⁻¹, and in the mean exactly so. A variance known from some ten parts
    # scatters by √(2/10), from two glints by about its own size: 2 % in the mean of 3000.
    _, covariances = drawn(weights, lambda rng: rng.normal(size=PLACES.size) / np.sqrt(weights))
    expected = np.linalg.inv(DESIGNS.T @ (weights[:, None] * DESIGNS))
    scale = np.sqrt(np.diag(expected))
    difference = (covariances.mean(axis=0) - expected) / np.outer(scale, scale)
    assert np.abs(difference).max() < 0.08


def test_a_95_percent_region_is_one_where_a_wall_has_many_parts() -> None:
    errors, covariances = drawn(EVEN, lambda rng: rng.normal(size=PLACES.size))
    squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors)
    # 5.99 is exceeded by χ² in 5 % of all draws, by 2 F(2, n) in 9 % if all twelve parts count
    # (n = 11), and in 14 % if half of them, those at its ends that hold the tilt (n = 5).
    assert 0.86 < np.mean(squares < 5.99) < 0.95


def test_neighbours_that_push_together_count_as_one() -> None:
    def smooth(rng: np.random.Generator) -> np.ndarray:
        return np.convolve(rng.normal(size=PLACES.size + 4), np.ones(5), "valid")

    errors, covariances = drawn(EVEN, smooth)
    # Five places of a part's twenty: what crosses its two edges, a tenth, is lost. Taken one by
    # one the places would tell a fifth of this.
    ratios = np.diag(covariances.mean(axis=0)) / np.diag(np.cov(errors.T))
    assert np.all((ratios > 0.8) & (ratios < 1.05))


def test_neighbours_that_push_against_each_other_hardly_count() -> None:
    def opposed(rng: np.random.Generator) -> np.ndarray:
        return np.diff(rng.normal(size=PLACES.size + 1))

    _, covariances = drawn(EVEN, opposed)
    alone = 2 * np.linalg.inv(DESIGNS.T @ DESIGNS)  # were each push independent
    assert np.all(np.diag(covariances.mean(axis=0)) < 0.15 * np.diag(alone))


def test_a_line_that_hangs_on_one_glint_turns_as_the_rest_of_the_wall_lets_it() -> None:
    one = EVEN.copy()
    one[180] = 1e6
    _, covariances = drawn(one, lambda rng: rng.normal(size=PLACES.size) / np.sqrt(one))
    # The glint is a hinge; the other places tell the tilt about it.
    tilt = 1 / np.sum((DESIGNS[:, 1] - DESIGNS[180, 1]) ** 2)
    assert covariances[:, 1, 1].mean() == pytest.approx(tilt, rel=0.1)


def test_rounding_does_not_decide_to_which_part_a_place_belongs() -> None:
    # 241 places in twelve parts: every twentieth lies on a cut.
    scores = np.random.default_rng(2).normal(size=PLACES.size)
    first, other = (
        cluster_robust_covariance(places, DESIGNS, scores, DESIGNS, part=PART)
        for places in (PLACES * (1 - 1e-13), PLACES * (1 + 1e-13) + 1e-16)
    )
    np.testing.assert_allclose(first, other, rtol=1e-9)
