from itertools import pairwise, product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from simulator.geometry.mirrors import Mirrors
from simulator.materials.fresnel_slab import Conductor
from simulator.specular import many_sequences
from simulator.specular.image_method import find_chains
from simulator.specular.many_sequences import leading_sequences

SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def clear_air(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.zeros(len(starts), dtype=bool)


def plates(seed: int, count: int = 8) -> Mirrors:
    """Plates and triangles of up to 4 m at random places of a room of 6 m."""
    rng = np.random.default_rng(seed)
    corners = np.array(
        [
            rng.uniform(0.8, 2.0) * SQUARE @ Rotation.random(rng=rng).as_matrix().T
            + rng.uniform(-3, 3, 3)
            for _ in range(count)
        ]
    )
    corners[::3, 3] = corners[::3, 2]  # triangles repeat a corner
    return Mirrors(
        corners=corners,
        materials=(Conductor(),) * count,
        rms_heights=np.zeros(count),
        two_sided=np.arange(count) % 2 == 0,
    )


def test_the_sequences_that_are_left_are_those_that_the_image_method_finds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(many_sequences, "AT_ONCE", 100)  # several parts
    found = 0
    for seed in range(3):
        mirrors, rng = plates(seed), np.random.default_rng(100 + seed)
        starts, ends = rng.uniform(-3, 3, (2, 12, 3))
        every = [
            one
            for length in (1, 2, 3)
            for one in product(range(len(mirrors)), repeat=length)
            if all(a != b for a, b in pairwise(one))
        ]
        exact = {
            chain.mirrors
            for start, end in zip(starts, ends, strict=True)
            for chain in find_chains(
                mirrors, start[None], end[None], blocked=clear_air, max_bounces=3, min_bounces=1
            )
        }
        assert set(leading_sequences(mirrors, every, starts, ends)) == exact
        found += len(exact)
    assert found > 20


def test_the_direct_way_always_leads() -> None:
    ends = np.array([[1.0, 0.0, 0.0]])
    assert leading_sequences(plates(0), [()], np.zeros((1, 3)), ends) == [()]
