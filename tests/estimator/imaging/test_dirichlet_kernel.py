"""Profiles of points at a sweep's own bins, against the sum over its frequencies."""

import numpy as np
import pytest
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.imaging.dirichlet_kernel import (
    Sweep,
    point_profiles,
    point_slopes,
    profiles_and_slopes,
)

SWEEP = Sweep(centre=275e9, step=20e6, count=401)
BINS = np.arange(220, 260) * SWEEP.bin_width


def summed(ranges: Float[np.ndarray, "positions points"]) -> Complex[np.ndarray, "rows points"]:
    offsets = (np.arange(SWEEP.count) - (SWEEP.count - 1) / 2) * SWEEP.step
    waves = np.exp(-4j * np.pi / speed_of_light * (offsets[:, None, None] + SWEEP.centre) * ranges)
    turns = np.exp(4j * np.pi / speed_of_light * np.outer(BINS, offsets)) / np.sqrt(SWEEP.count)
    return np.asarray(np.einsum("bf,fmp->mbp", turns, waves).reshape(-1, ranges.shape[1]))


@pytest.mark.parametrize("where", ["anywhere", "on bins"])
def test_profiles_and_slopes_are_those_of_the_sum(where: str) -> None:
    rng = np.random.default_rng(1)
    ranges: np.ndarray = rng.uniform(BINS[5], BINS[-5], (3, 7))
    if where == "on bins":
        ranges = BINS[rng.integers(5, BINS.size - 5, ranges.shape)]
    rates = rng.uniform(-1, 1, ranges.shape)
    profiles, slopes = profiles_and_slopes(SWEEP, BINS, ranges, rates)
    np.testing.assert_array_equal(profiles, point_profiles(SWEEP, BINS, ranges))
    np.testing.assert_array_equal(slopes, point_slopes(SWEEP, BINS, ranges, rates))
    # Rounding: phases of a few thousand turns in double precision, summed over the sweep.
    np.testing.assert_allclose(profiles, summed(ranges), atol=1e-10 * np.sqrt(SWEEP.count))
    step = 1e-8  # of what moves the points; the carrier turns by 1e-4 [m]
    change = (summed(ranges + step * rates) - summed(ranges - step * rates)) / (2 * step)
    largest = 4 * np.pi * SWEEP.centre / speed_of_light * np.sqrt(SWEEP.count)
    # A central difference errs by a sixth of that turn squared, 2e-9, and by the rounding of phases
    # of thousands of turns, 1e-12 rad over 1e-4.
    np.testing.assert_allclose(slopes, change, atol=1e-7 * largest)
