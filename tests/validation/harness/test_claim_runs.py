import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from validation.claims import ALL_CLAIMS
from validation.harness import claim_runs
from validation.harness.claim import Claim, Effort, Finding, Row, Tell
from validation.harness.claim_runs import ClaimRun, run_claims, run_document
from validation.harness.planted_errors import PLANTED, plant
from validation.harness.results_page import drifted, record_results, recorded_page


def row(measured: float, *, low: float | None = None, high: float | None = 1.0) -> Row:
    return Row(name="length", stated="1 m", measured=measured, unit="m", low=low, high=high,
               origin="the ruler")  # fmt: skip


def claim(measure: Callable[[], Finding], key: str = "ruler") -> Claim:
    def measured(effort: Effort, tell: Tell) -> Finding:
        tell(1, 1)
        return measure()

    return Claim(key=key, title="A ruler is as long as a ruler", source="trade", measure=measured)


def runs(folder: Path, *claims: Claim, fresh: bool = False) -> list[ClaimRun]:
    return list(run_claims(claims, effort="quick", folder=folder, fresh=fresh))


@pytest.mark.parametrize(
    ("measured", "low", "high", "passed"),
    [
        (1.0, None, 1.0, True),
        (1.1, None, 1.0, False),
        (0.9, 1.0, None, False),
        (1.5, 1.0, 2.0, True),
        (float("nan"), 0.0, None, False),
        (float("inf"), 0.0, None, False),
    ],
)
def test_a_figure_passes_within_its_limits_and_never_if_it_is_no_number(
    measured: float, low: float | None, high: float | None, passed: bool
) -> None:
    assert row(measured, low=low, high=high).passed is passed


def test_a_figure_without_a_limit_is_refused() -> None:
    with pytest.raises(ValueError, match="'length' has no limit; give low or high"):
        row(1.0, high=None)


def test_what_is_measured_is_kept_until_the_code_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def measure() -> Finding:
        calls.append(1)
        return Finding(rows=[row(0.5)], remarks=("by hand",))

    (first,), (second,) = runs(tmp_path, claim(measure)), runs(tmp_path, claim(measure))
    assert len(calls) == 1
    assert (first.kept, second.kept) == (False, True)
    assert run_document(first) == run_document(second)
    runs(tmp_path, claim(measure), fresh=True)
    assert len(calls) == 2
    monkeypatch.setattr(claim_runs, "claims_digest", lambda: "other code")
    runs(tmp_path, claim(measure))
    assert len(calls) == 3


def test_a_torn_file_is_measured_again(tmp_path: Path) -> None:
    (tmp_path / "ruler.json").write_text('{"digest": "')
    (run,) = runs(tmp_path, claim(lambda: Finding(rows=[row(0.5)])))
    assert not run.kept
    assert json.loads((tmp_path / "ruler.json").read_text())["passed"]


def test_a_claim_that_raises_has_failed_and_the_next_one_goes_on(tmp_path: Path) -> None:
    def broken() -> Finding:
        raise RuntimeError("the ruler is broken")

    first, second = runs(tmp_path, claim(broken, "broken"), claim(lambda: Finding(rows=[row(0.5)])))
    assert not first.passed
    assert first.problem == "RuntimeError: the ruler is broken"
    assert second.passed
    assert not (tmp_path / "broken.json").exists()  # so that it is tried again


def test_a_figure_that_cannot_be_drawn_fails_and_hides_no_numbers(tmp_path: Path) -> None:
    def draw(figure: object) -> None:
        raise RuntimeError("no ink")

    (run,) = runs(tmp_path, claim(lambda: Finding(rows=[row(0.5)], draw=draw)))
    assert not run.passed
    assert run.problem == "RuntimeError: no ink"
    assert [one.measured for one in run.rows] == [0.5]


def test_the_page_of_results_says_what_was_measured(tmp_path: Path) -> None:
    found = runs(
        tmp_path / "run",
        claim(lambda: Finding(rows=[row(0.5)], draw=lambda figure: None)),
        claim(lambda: Finding(rows=[row(2.0)]), "other"),
    )
    document = {
        "effort": "quick",
        "code": "a1b2",
        "claims": [run_document(run) for run in found],
    }
    record_results(document, tmp_path / "docs", tmp_path / "run")
    page = (tmp_path / "docs" / "index.md").read_text()
    assert page == recorded_page(tmp_path / "docs")
    assert "1 of 2 figures of 2 claims are within their limits" in page
    assert "| length | 1 m | 2 m | ≤ 1 m | the ruler | **fails** |" in page
    assert "quick forms by sources `a1b2` (" in page
    assert (tmp_path / "docs" / "quick_ruler.png").is_file()


def as_it_is(finding: Finding) -> Finding:
    """Measure nothing."""
    return finding


def test_the_page_shows_the_full_form_and_says_if_the_quick_one_is_of_other_sources(
    tmp_path: Path,
) -> None:
    for effort, code, length in (("quick", "a1b2", 0.25), ("full", "c3d4", 0.75)):
        finding = Finding(rows=[row(length)], draw=lambda figure: None)
        (run,) = runs(tmp_path / effort, claim(partial(as_it_is, finding)))
        document = {"effort": effort, "code": code, "claims": [run_document(run)]}
        record_results(document, tmp_path / "docs", tmp_path / effort)
    page = (tmp_path / "docs" / "index.md").read_text()
    assert "0.75 m" in page
    assert "0.25 m" not in page
    assert "quick forms by sources `a1b2`, full forms by sources `c3d4`, which differ" in page
    # A picture that the page no longer shows is not left behind.
    assert [path.name for path in (tmp_path / "docs").glob("*.png")] == ["full_ruler.png"]


def test_a_stated_figure_that_no_longer_holds_is_named(tmp_path: Path) -> None:
    def document(value: float) -> dict[str, object]:
        made = runs(tmp_path, claim(lambda: Finding(rows=[row(value)])), fresh=True)
        return {"effort": "quick", "claims": [run_document(run) for run in made]}

    # Within 5 % of the limit, 1 m: other processors round otherwise.
    assert drifted(document(0.54), document(0.5)) == []
    assert drifted(document(0.6), document(0.5)) == [
        "ruler, length: stated as 0.5 m, measured 0.6 m"
    ]
    empty = {"effort": "quick", "claims": [{"key": "ruler", "rows": []}]}
    assert drifted(empty, document(0.5)) == ["ruler, length: stated as 0.5 m, not measured now"]


def test_claims_have_keys_of_their_own() -> None:
    keys = [one.key for one in ALL_CLAIMS]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("error", PLANTED, ids=lambda error: error.name)
def test_each_error_can_be_planted_and_has_claims_to_turn_red(
    error: object, tmp_path: Path
) -> None:
    (chosen,) = (one for one in PLANTED if one is error)
    known = {one.key for one in ALL_CLAIMS if one.quick}
    assert set(chosen.claims) <= known
    plant(chosen, tmp_path)  # raises if the line is not there exactly once
    assert chosen.wrong in (tmp_path / chosen.file).read_text(encoding="utf-8")


def test_the_page_of_results_is_the_one_that_its_figures_make() -> None:
    folder = Path(__file__).parents[3] / "docs" / "results"
    assert (folder / "index.md").read_text(encoding="utf-8") == recorded_page(folder)
