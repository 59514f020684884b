import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenes.random_streams import random_stream


def draw(seed: int, sample: int, name: str) -> np.ndarray:
    return random_stream(seed, sample, name).standard_normal(20_000)


@given(st.integers(0, 2**70), st.integers(0, 2**40), st.text(min_size=1))
def test_a_stream_depends_on_seed_sample_and_name_alone(seed: int, sample: int, name: str) -> None:
    first = random_stream(seed, sample, name)
    random_stream(seed, sample, name + "x").standard_normal(3)
    assert first.standard_normal(4).tobytes() == (
        random_stream(seed, sample, name).standard_normal(4).tobytes()
    )


@pytest.mark.parametrize(
    "other",
    [(8, 0, "noise/echo"), (7, 1, "noise/echo"), (7, 0, "noise/uplink"), (0, 7, "noise/echo")],
)
def test_another_seed_sample_or_name_is_independent(other: tuple[int, int, str]) -> None:
    correlation = np.corrcoef(draw(7, 0, "noise/echo"), draw(*other))[0, 1]
    assert abs(correlation) < 4.5 / np.sqrt(20_000)  # 4.5 standard deviations of a chance one


@given(st.integers(0, 2**33), st.integers(0, 2**33), st.integers(0, 2**33), st.integers(0, 2**33))
def test_streams_of_different_seeds_and_samples_never_coincide(
    a: int, b: int, c: int, d: int
) -> None:
    if (a, b) != (c, d):
        assert random_stream(a, b, "x").integers(2**63) != random_stream(c, d, "x").integers(2**63)


def test_a_stream_is_the_same_for_good() -> None:
    # A stored reference: whoever changes the key of the streams changes every data set.
    assert random_stream(1, 2, "roughness/wall").integers(2**32) == 2664086500


def test_negative_seeds_and_samples_are_refused() -> None:
    with pytest.raises(ValueError, match="seed = -1 must not be negative"):
        random_stream(-1, 0, "x")
    with pytest.raises(ValueError, match="sample = -3 must not be negative"):
        random_stream(0, -3, "x")


def test_a_stream_without_a_name_is_refused() -> None:
    with pytest.raises(ValueError, match="needs a name"):
        random_stream(0, 0, "")
