"""The tests check the types and shapes of what our functions are given."""

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from estimator.geometry.wall_2d import unit_normal
from tests.type_checks import FIRST


def test_a_place_in_the_plane_is_refused_where_one_in_space_is_needed() -> None:
    space, plane = np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0])
    for _ in range(FIRST // 2):
        unit_normal(np.zeros(3), space)
    with pytest.raises(TypeCheckError, match="unit_normal"):
        unit_normal(plane, space)
