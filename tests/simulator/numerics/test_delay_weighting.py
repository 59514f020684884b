import numpy as np
import pytest
from jaxtyping import Complex

from scenes.schema.air import Air
from simulator.materials.gas_absorption import decay_rate
from simulator.numerics.delay_weighting import decayed, neighbour_grid

SPEED = 299792458.0


def paths(frequencies: np.ndarray, delays: np.ndarray) -> Complex[np.ndarray, "1 freqs"]:
    return np.asarray(np.exp(-2j * np.pi * np.outer(delays, frequencies)).sum(axis=0)[None])


@pytest.mark.parametrize(
    ("start", "stop", "lengths"),
    [
        (300e9, 350e9, (1.5, 7.2)),  # over the 325 GHz line of water
        (57e9, 64e9, (3.0, 100.0)),  # over the oxygen's band
        (220e9, 295e9, (0.02, 30.0)),
    ],
)
@pytest.mark.parametrize("points", [31, 401])
def test_each_path_is_absorbed_over_its_own_length(
    start: float, stop: float, lengths: tuple[float, float], points: int
) -> None:
    frequencies, air = np.linspace(start, stop, points), Air()
    delays = np.array(lengths) / SPEED
    grid = neighbour_grid(frequencies, 1.2 * delays.max())
    fine = np.linspace(grid.start, grid.stop, grid.points)
    rates = SPEED * decay_rate(air, frequencies)
    found = decayed(paths(fine, delays), grid, rates)
    left = np.exp(-np.outer(delays, rates))
    wanted = (left * np.exp(-2j * np.pi * np.outer(delays, frequencies))).sum(axis=0)
    # 4e-7 of the longest delay's decay for each of two paths (a fit, worst of all delays).
    most = -np.expm1(-grid.longest * rates.max())
    assert np.abs(found[0] - wanted).max() < 1e-6 * most


def test_without_decay_the_samples_are_those_of_the_grid() -> None:
    frequencies, delays = np.linspace(75e9, 110e9, 51), np.array([1e-9, 20e-9])
    grid = neighbour_grid(frequencies, 30e-9)
    fine = np.linspace(grid.start, grid.stop, grid.points)
    found = decayed(paths(fine, delays), grid, np.zeros(51))
    np.testing.assert_allclose(found, paths(frequencies, delays), atol=1e-9)
