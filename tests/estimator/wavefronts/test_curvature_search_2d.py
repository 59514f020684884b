"""The start of a wave's fit, against waves of elements that stand anywhere in the plane."""

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.measurement.model import Uplink
from estimator.wavefronts.curvature_search_2d import search_curvature

BAND = np.linspace(220e9, 295e9, 61)


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.01, 0.0), (0.0, 0.02), (-0.03, -0.02)])
def test_a_source_is_found_where_it_is_from_elements_beside_and_in_front_of_the_origin(
    place: tuple[float, float],
) -> None:
    positions = np.zeros((64, 3))
    positions[:, 0] = (np.arange(64) - 31.5) * 0.5e-3
    positions[:, :2] += place
    user = np.array([0.1, 0.3, 0.0])
    lengths = np.linalg.norm(user - positions, axis=1)
    samples = np.exp(-2j * np.pi * np.outer(lengths, BAND) / speed_of_light)
    uplink = Uplink(samples=samples, positions=positions, frequencies=BAND, user="a")
    aoa, distance = float(np.arctan2(0.3, 0.1)), float(np.hypot(0.1, 0.3))
    start = search_curvature(uplink, aoa=aoa, path_length=distance)
    # The grid holds the angle and the length that it starts from; a sample is c/8B.
    assert start.aoa == pytest.approx(aoa, abs=1e-9)
    assert start.path_length == pytest.approx(distance, abs=1e-9)
    assert start.radius == pytest.approx(distance, rel=0.05)
