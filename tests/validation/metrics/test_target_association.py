import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.results.estimate import Mirror, Target
from validation.metrics.target_association import associate, compare_targets
from validation.metrics.truth import Truth

ROUNDING = 1e-12  # of sums over metres in double precision


def points(*pairs: tuple[float, float]) -> np.ndarray:
    return np.array(pairs, dtype=np.float64).reshape(-1, 2)


def test_the_same_points_in_any_order_are_no_distance_apart() -> None:
    truths = points((0.0, 0.0), (1.0, 0.0), (0.3, 2.0))
    found = associate(truths[[2, 0, 1]], truths, cutoff=0.1)
    assert found.ospa == 0.0
    assert set(found.pairs) == {(0, 2), (1, 0), (2, 1)}
    assert (found.missed, found.false) == ((), ())


def test_a_miss_and_a_false_target_cost_the_cutoff() -> None:
    missed = associate(points((0.0, 0.0)), points((0.0, 0.0), (5.0, 0.0)), cutoff=0.3)
    assert (missed.missed, missed.false) == ((1,), ())
    assert missed.ospa == pytest.approx(0.3 / np.sqrt(2))
    both = associate(points((9.0, 0.0)), points((5.0, 0.0)), cutoff=0.3)
    assert (both.missed, both.false, both.pairs) == ((0,), (0,), ())
    assert both.ospa == pytest.approx(0.3)


def test_the_metric_is_that_of_its_definition() -> None:
    rng = np.random.default_rng(3)
    estimates, truths = rng.uniform(size=(3, 2)), rng.uniform(size=(5, 2))
    for order in (1.0, 2.0):
        best = min(
            sum(
                min(float(np.linalg.norm(estimate - truths[index])), 0.4) ** order
                for estimate, index in zip(estimates, chosen, strict=True)
            )
            for chosen in itertools.permutations(range(5), 3)
        )
        expected = ((best + 2 * 0.4**order) / 5) ** (1 / order)
        found = associate(estimates, truths, cutoff=0.4, order=order)
        assert found.ospa == pytest.approx(expected, abs=ROUNDING)
        parts = found.localization**order + found.cardinality**order
        assert parts ** (1 / order) == pytest.approx(expected, abs=ROUNDING)


@given(
    sizes=st.tuples(*[st.integers(0, 4)] * 3),
    seed=st.integers(0, 2**16),
    order=st.sampled_from([1.0, 2.0]),
)
def test_it_is_a_metric(sizes: tuple[int, int, int], seed: int, order: float) -> None:
    rng = np.random.default_rng(seed)
    a, b, c = (rng.uniform(size=(size, 2)) for size in sizes)

    def ospa(first: np.ndarray, second: np.ndarray) -> float:
        return associate(first, second, cutoff=0.5, order=order).ospa

    assert ospa(a, b) == pytest.approx(ospa(b, a), abs=ROUNDING)
    assert ospa(a, c) <= ospa(a, b) + ospa(b, c) + ROUNDING
    assert ospa(a, b) <= 0.5 + ROUNDING


def test_the_total_distance_counts_not_each_by_itself() -> None:
    # The nearest to both is the first truth; the second estimate then has to go without.
    found = associate(points((0.0, 0.0), (0.1, 0.0)), points((0.04, 0.0), (-0.2, 0.0)), cutoff=1.0)
    assert set(found.pairs) == {(0, 1), (1, 0)}


def test_a_post_behind_a_mirror_is_compared_where_its_image_shows_it() -> None:
    # The mirror x = 0.3: the array at the origin sees the post from its image at (0.6, 0).
    wall = Mirror(
        start=np.array([0.3, 0.0, 0.0]),
        end=np.array([0.3, 1.0, 0.0]),
        normal=np.array([-1.0, 0.0, 0.0]),
        covariance=np.eye(2),
        confidence=1.0,
        level_db=20.0,
    )
    truth = Truth(
        target_position={"post": np.array([0.1, 0.5, 0.0]), "other": np.array([0.0, 0.9, 0.0])},
        target_size={"post": np.array([0.01, 0.01, 0.0])},
        target_kind={"post": "cylinder", "other": "point"},
    )
    towards = np.array([0.5, -0.5, 0.0]) / np.hypot(0.5, 0.5)
    face = truth.target_position["post"] + 0.005 * towards
    hidden = Target(position=face, ghost=np.array([0.6, 0.0, 0.0]) - face, seen_through=(0,))
    stray = Target(position=np.array([1.0, 1.0, 0.0]), ghost=np.array([1.0, 1.0, 0.0]))
    found = compare_targets(
        [stray, hidden], truth, mirrors=[wall], aperture=np.zeros(3), cutoff=0.05
    )
    assert found.names == (None, "post")
    assert found.errors[1] == pytest.approx(0.0, abs=ROUNDING)
    assert found.missed == ("other",)
    assert found.ospa == pytest.approx(0.05 / np.sqrt(2))
    # Seen directly, the same place would be on the wrong side of the post.
    direct = Target(position=face, ghost=face)
    (error,) = compare_targets(
        [direct], truth, mirrors=[wall], aperture=np.zeros(3), cutoff=0.05
    ).errors
    assert error is not None
    assert error > 0.004  # the faces of a post of 5 mm, 56° apart around it


def test_nothing_expected_and_nothing_found_is_right() -> None:
    found = associate(np.zeros((0, 3)), np.zeros((0, 3)), cutoff=1.0)
    assert (found.ospa, found.pairs, found.missed, found.false) == (0.0, (), (), ())


def test_a_cutoff_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="give > 0 and ≥ 1"):
        associate(points((0.0, 0.0)), points((0.0, 0.0)), cutoff=0.0)
    with pytest.raises(ValueError, match="give > 0 and ≥ 1"):
        associate(points((0.0, 0.0)), points((0.0, 0.0)), cutoff=1.0, order=0.5)
