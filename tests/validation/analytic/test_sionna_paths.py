"""Our specular chains against Sionna RT's deterministic path solver, on random 3-D scenes."""

from functools import partial

import numpy as np
import pytest

from simulator.geometry import ray_scene
from validation.analytic.sionna_paths import (
    EDGE,
    LIMIT_AMPLITUDE,
    LIMIT_LENGTH,
    compare_paths,
    distance_from_edges,
    our_paths,
    random_scene,
    solver_scene,
)

SCENES = 60


@pytest.mark.parametrize(
    "seed",
    [seed if seed < 12 else pytest.param(seed, marks=pytest.mark.slow) for seed in range(SCENES)],
)
def test_chains_delays_and_coefficients_are_those_of_the_path_solver(seed: int) -> None:
    found = compare_paths(random_scene(seed))
    assert found.bounces
    assert not found.alone, "found by only one of the two"
    assert found.length <= LIMIT_LENGTH
    assert found.amplitude < LIMIT_AMPLITUDE


@pytest.mark.parametrize("seed", range(6))
def test_occlusion_by_mitsuba_leaves_the_same_paths(seed: int) -> None:
    scene = random_scene(seed)
    theirs, _ = solver_scene(scene)
    rays = ray_scene.RayScene(scene=theirs, centre=np.zeros(3), clearance=ray_scene.CLEARANCE)
    exact, traced = our_paths(scene), our_paths(scene, partial(ray_scene.blocked, rays))
    for key in exact.keys() ^ traced.keys():
        path = exact[key] if key in exact else traced[key]
        assert distance_from_edges(path, scene.corners) < EDGE
    assert len(exact.keys() & traced.keys()) > 1


def test_the_random_scenes_have_paths_of_every_number_of_bounces() -> None:
    counts = np.zeros(4, dtype=int)
    for seed in range(6):
        counts += np.bincount(
            [len(sequence) for _, sequence in our_paths(random_scene(seed))], minlength=4
        )
    assert np.all(counts >= 3), counts
