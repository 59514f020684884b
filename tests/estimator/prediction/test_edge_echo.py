"""Keller's edge echoes against limits in closed form."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.prediction.edge_echo import edge_echoes_db

FREQUENCY = 260e9


def test_a_plate_seen_edge_on_has_no_near_edge_echo_across_but_a_full_one_along() -> None:
    edges = np.array([[0.0, 0.5, 0.0], [0.0, 0.8, 0.0]])
    along, across, _ = edge_echoes_db(edges, FREQUENCY)
    wavelength = speed_of_light / FREQUENCY
    # |D| = 1/sqrt(2 pi k) head-on, with the field along the edge of a half plane.
    expected = wavelength / (4 * np.pi) * np.sqrt(wavelength) / (2 * np.pi) / np.sqrt(2 * 0.5**3)
    assert along[0] == pytest.approx(20 * np.log10(expected), abs=0.01)
    assert across[0] < along[0] - 60


def test_levels_fall_by_30_db_a_decade_of_distance() -> None:
    edges = np.array([[-0.1, 0.6, 0.0], [0.1, 0.8, 0.0]])
    fall = edge_echoes_db(edges, FREQUENCY) - edge_echoes_db(10 * edges, FREQUENCY)
    np.testing.assert_allclose(fall, 30.0, atol=1e-9)


def test_the_mirrored_plate_has_the_same_edges() -> None:
    edges = np.array([[-0.1, 0.6, 0.0], [0.15, 0.8, 0.0]])
    mirrored = edges * [-1, 1, 1]
    np.testing.assert_allclose(
        edge_echoes_db(edges, FREQUENCY), edge_echoes_db(mirrored, FREQUENCY), atol=1e-9
    )
    np.testing.assert_allclose(
        edge_echoes_db(edges[::-1], FREQUENCY), edge_echoes_db(edges, FREQUENCY)[:, ::-1], atol=1e-9
    )
