"""Heights of other distributions, from the same Gaussian surface."""

import numpy as np
import pytest

from scenes.surfaces.height_distribution import lognormal_width, transformed

COUNT = 400_000
GAUSSIAN = 2e-5 * np.random.default_rng(1).standard_normal(COUNT)


def moments(heights: np.ndarray) -> tuple[float, float]:
    """Root mean square and skewness."""
    rms = float(np.sqrt(np.mean(heights**2)))
    return rms, float(np.mean(heights**3)) / rms**3


@pytest.mark.parametrize("skewness", [-1.5, -0.5, 0.3, 1.5])
def test_lognormal_heights_have_the_rms_and_the_skewness_asked_for(skewness: float) -> None:
    found = transformed(GAUSSIAN, rms=2e-5, distribution="lognormal", skewness=skewness)
    rms, skew = moments(found)
    # Third moments of heavy tails scatter by their sixth: 20 of them at most.
    assert rms == pytest.approx(2e-5, rel=0.02)
    assert skew == pytest.approx(skewness, abs=5 * np.sqrt(20 * (1 + skewness**2) ** 3 / COUNT))


def test_uniform_heights_end_at_root_three_of_their_rms() -> None:
    found = transformed(GAUSSIAN, rms=2e-5, distribution="uniform", skewness=0.0)
    assert moments(found)[0] == pytest.approx(2e-5, rel=5 / np.sqrt(COUNT))
    assert np.abs(found).max() == pytest.approx(np.sqrt(3) * 2e-5, rel=1e-3)


def test_the_surface_rises_where_the_gaussian_one_does() -> None:
    order = np.argsort(GAUSSIAN[:1000])
    for distribution, skewness in (("uniform", 0.0), ("lognormal", 1.0), ("lognormal", -1.0)):
        found = transformed(GAUSSIAN[:1000], rms=2e-5, distribution=distribution, skewness=skewness)  # type: ignore[arg-type]
        assert np.all(np.diff(found[order]) > 0)


@pytest.mark.parametrize("skewness", [0.01, 1.0, 3.0])
def test_the_width_of_a_lognormal_gives_back_its_skewness(skewness: float) -> None:
    spread = np.exp(lognormal_width(skewness) ** 2)
    assert (spread + 2) * np.sqrt(spread - 1) == pytest.approx(skewness, rel=1e-9)
