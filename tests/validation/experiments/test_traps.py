"""Rooms that invite a confident wrong answer."""

import pytest

from validation.experiments.traps import Trial, trial
from validation.trials.trap_rooms import TRAPS

FAST = ("edge-on, at the side", "smooth wall", "behind")
"""One each of a mirror, a user and nothing at all that a careless estimator would claim."""


def run(name: str, seed: int = 0) -> Trial:
    return trial(*TRAPS[name], seed=seed)


def test_a_wall_seen_edge_on_is_no_mirror_and_the_user_beside_it_is_found() -> None:
    result = run("edge-on, at the side")
    assert result.mirrors == ()
    assert result.status == "found"
    assert result.wrong == ()


def test_a_wall_too_smooth_to_be_seen_makes_no_confident_wrong_place() -> None:
    result = run("smooth wall")
    assert result.status == "ambiguous"
    # Taken for direct, the path ends where the wall shows the user: 64 cm away from it.
    assert result.error == pytest.approx(0.45 * 2**0.5, abs=1e-3)
    assert result.wrong == ()


def test_behind_a_mirror_no_user_is_heard() -> None:
    result = run("behind")
    assert result.status == "not_found"
    assert [one.wall for one in result.mirrors] == ["wall"]


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in TRAPS if name not in FAST])
def test_no_trap_gives_a_confident_wrong_answer(name: str) -> None:
    assert run(name).wrong == ()
