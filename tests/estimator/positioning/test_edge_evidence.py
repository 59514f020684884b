"""Levels of two points that are, or are not, the edges of a mirror."""

import numpy as np

from estimator.positioning.edge_evidence import OTHERWISE, odds_of_edges
from estimator.prediction.edge_echo import edge_echoes_db

EDGES = np.array([[-0.1, 0.6, 0.0], [0.12, 0.85, 0.0]])
FREQUENCY = 260e9


def test_a_conductors_levels_tell_for_it() -> None:
    along, across, lossy = edge_echoes_db(EDGES, FREQUENCY)
    assert odds_of_edges(EDGES, along, FREQUENCY).metal > 20
    assert odds_of_edges(EDGES, across, FREQUENCY).metal > 10
    assert odds_of_edges(EDGES, lossy - 12, FREQUENCY).lossy > 5
    # Antennas of any gain leave the difference of the levels.
    assert 1 < odds_of_edges(EDGES, along + 15, FREQUENCY).metal < 10


def test_levels_that_no_mirror_has_tell_against_all() -> None:
    along = edge_echoes_db(EDGES, FREQUENCY)[0]
    odds = odds_of_edges(EDGES, along + np.array([30.0, -30.0]), FREQUENCY)
    assert odds.metal < 1.01 * OTHERWISE
    assert odds.lossy < 1.01 * OTHERWISE


def test_chance_has_odds_of_one_in_the_mean() -> None:
    rng = np.random.default_rng(1)
    middle = edge_echoes_db(EDGES, FREQUENCY).mean()
    # As widely as the density of unrelated points says.
    drawn = [
        odds_of_edges(EDGES, middle + rng.uniform(-40, 40, 2), FREQUENCY) for _ in range(20_000)
    ]
    assert 0.7 < np.mean([one.metal for one in drawn]) < 1.1
    assert 0.5 < np.mean([one.lossy for one in drawn]) < 1.1
