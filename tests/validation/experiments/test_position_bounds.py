from dataclasses import replace

import pytest

from validation.experiments.baselines import (
    BOTH,
    HIDDEN,
    OURS,
    SIGHT,
    Trial,
)
from validation.experiments.baselines import (
    check as check_methods,
)
from validation.experiments.position_bounds import check, free_space


def test_a_few_trials_in_free_space_keep_to_the_bound() -> None:
    found = free_space(True, 6, bandwidth=20e9, elements=24)
    assert found.answered == 6
    (line,) = check([found])
    assert "one known mirror" in line
    assert found.expected == found.bound


def test_errors_far_above_or_below_the_bound_are_refused() -> None:
    found = free_space(False, 6, bandwidth=20e9, elements=24)
    for factor in (2.0, 0.0):
        wrong = replace(found, measured=factor * found.bound, trials=100, answered=100)
        with pytest.raises(RuntimeError, match=r"claimed at most 1\.5"):
            check([wrong])
    with pytest.raises(RuntimeError, match="5 of 6 answered"):
        check([replace(found, answered=5)])


def trial(case: str, method: str, error: float | None) -> Trial:
    return Trial(
        case=case, method=method, x=0.0, y=0.0, seed=0, error=error, reason=None, duration=0.0
    )


FAIR = [
    *(trial(case, OURS, 3e-4) for case in (SIGHT, BOTH, HIDDEN)),
    trial(HIDDEN, "AoA+ToA, no map", 1.4),
    trial(HIDDEN, "RSSI ranging", None),
    trial(HIDDEN, "RSSI/AoA fingerprints", 0.05),
    trial(SIGHT, "ToA, 4 anchors", 2e-5),
]


def test_the_table_of_methods_has_a_row_for_each() -> None:
    told = check_methods(FAIR)
    assert len(told) == 6
    assert "no answer" in next(line for line in told if line.startswith("RSSI ranging"))


@pytest.mark.parametrize(
    ("case", "method", "error", "claim"),
    [
        (HIDDEN, OURS, 2e-3, "median below 1 mm"),
        (HIDDEN, OURS, None, "median below 1 mm"),
        (HIDDEN, "AoA+ToA, no map", 0.01, "decimetres at least"),
        (HIDDEN, "RSSI/AoA fingerprints", 1e-3, "centimetres"),
        (SIGHT, "ToA, 4 anchors", 0.01, "less than a millimetre"),
    ],
)
def test_a_claim_that_does_not_hold_is_named(
    case: str, method: str, error: float | None, claim: str
) -> None:
    rest = [one for one in FAIR if (one.case, one.method) != (case, method)]
    with pytest.raises(RuntimeError, match=claim):
        check_methods([*rest, trial(case, method, error)])
