import numpy as np
import pytest
from jaxtyping import Bool, Complex64, Float
from scipy.constants import speed_of_light

from simulator.numerics.butterfly import LINK_ACCURACY, plan_links, sum_planned

FREQUENCY = 330e9


def rough_line(
    start: tuple[float, float], end: tuple[float, float], facets: int, rms: float, seed: int
) -> Float[np.ndarray, "facets 2"]:
    along = np.array(end) - np.array(start)
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    heights = rms * np.random.default_rng(seed).standard_normal(facets)
    places = (np.arange(facets) + 0.5) / facets
    line: np.ndarray = np.array(start) + places[:, None] * along + heights[:, None] * normal
    return line


def circle(centre: tuple[float, float], radius: float, facets: int) -> Float[np.ndarray, "n 2"]:
    angles = 2 * np.pi * np.arange(facets) / facets
    points: np.ndarray = np.array(centre) + radius * np.stack([np.cos(angles), np.sin(angles)], -1)
    return points


def random_sources(facets: int, ports: int = 2) -> Complex64[np.ndarray, "3 ports facets"]:
    rng = np.random.default_rng(5)
    parts = rng.standard_normal((2, 3, ports, facets))
    return np.asarray(parts[0] + 1j * parts[1], dtype=np.complex64)


def plain_sum(
    sources: Complex64[np.ndarray, "3 ports wall"],
    wall: Float[np.ndarray, "wall 2"],
    target: Float[np.ndarray, "target 2"],
    seen: Bool[np.ndarray, "wall target"],
) -> np.ndarray:
    between = target - wall[:, None]
    distance = np.linalg.norm(between, axis=-1)
    turns = distance * FREQUENCY / speed_of_light
    links = seen * np.exp(-2j * np.pi * (turns - np.rint(turns))) / np.sqrt(distance)
    x, y = np.moveaxis(between / distance[..., None], -1, 0)
    monopole, along_x, along_y = sources.astype(np.complex128)
    return np.stack(
        [
            sum(part @ (links * across * away) for part, away in zip(
                (monopole, along_x, along_y), (1.0, x, y), strict=True
            ))
            for across in (1.0, -x, -y)
        ]
    )  # fmt: skip


WALL = rough_line((-0.1, 0.7), (0.1, 0.9), 900, 0.05e-3, 0)
CASES = {
    "another rough wall, far away": rough_line((0.8, 0.9), (1.0, 0.7), 800, 0.05e-3, 1),
    "a post": circle((0.3, 0.5), 5e-3, 134),
    "a wall that touches the first": rough_line((0.1, 0.9), (0.25, 0.75), 700, 0.05e-3, 2),
}


@pytest.mark.parametrize("target", CASES.values(), ids=CASES.keys())
def test_blocks_send_what_their_facets_send(target: np.ndarray) -> None:
    seen = np.ones((len(WALL), len(target)), dtype=bool)
    plan = plan_links(WALL, target, seen, FREQUENCY)
    sources = random_sources(len(WALL))
    summed = sum_planned(plan, sources, len(target), FREQUENCY)
    expected = plain_sum(sources, WALL, target, seen & ~plan.left)
    assert len(plan.pairs) > 0
    # The bound is of each contribution; random ones, which do not cancel, keep to it together.
    assert np.linalg.norm(summed - expected) <= LINK_ACCURACY / 10 * np.linalg.norm(expected)


def test_each_link_is_either_in_a_pair_of_blocks_or_left_over() -> None:
    target = CASES["a wall that touches the first"]
    seen = np.ones((len(WALL), len(target)), dtype=bool)
    seen[:300, 200:] = False  # a shadow's edge runs through blocks
    seen[5] = False
    plan = plan_links(WALL, target, seen, FREQUENCY)
    paired = np.zeros(seen.shape, dtype=int)
    for pair in plan.pairs:
        senders = plan.senders[pair.sender].members[pair.sends]
        receivers = plan.receivers[pair.receiver].members[pair.hears]
        paired[np.ix_(senders, receivers)] += 1
    np.testing.assert_array_equal(paired + plan.left, seen.astype(int))
    assert plan.left.any()
    assert paired.any()


def test_what_is_hidden_receives_nothing() -> None:
    target = CASES["another rough wall, far away"]
    seen = np.ones((len(WALL), len(target)), dtype=bool)
    seen[:, 100:] = False
    plan = plan_links(WALL, target, seen, FREQUENCY)
    summed = sum_planned(plan, random_sources(len(WALL)), len(target), FREQUENCY)
    assert np.all(summed[..., 100:] == 0)
    expected = plain_sum(random_sources(len(WALL)), WALL, target, seen & ~plan.left)
    assert np.linalg.norm(summed - expected) <= LINK_ACCURACY * np.linalg.norm(expected)


def test_links_between_distant_walls_are_far_fewer_than_their_facets_pairs() -> None:
    target = CASES["another rough wall, far away"]
    plan = plan_links(WALL, target, np.ones((len(WALL), len(target)), dtype=bool), FREQUENCY)
    points = sum(pair.mixed.size for pair in plan.pairs)
    assert not plan.left.any()
    assert points < len(WALL) * len(target) / 20
