import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mmslam.cli import app
from mmslam.commands import validate
from validation.harness.claim import Claim, Effort, Finding, Row, Tell


def row(measured: float) -> Row:
    return Row(name="length", stated="1 m", measured=measured, unit="m", high=1.0, origin="ruler")


def claim(key: str, measured: float, *, quick: bool = True) -> Claim:
    def measure(effort: Effort, tell: Tell) -> Finding:
        if measured < 0:
            raise KeyboardInterrupt
        tell(1, 1)
        return Finding(rows=[row(measured)])

    return Claim(key=key, title=f"About {key}", source="trade", measure=measure, quick=quick)


@pytest.fixture(autouse=True)
def _claims(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    made = (claim("good", 0.5), claim("bad", 2.0), claim("slow", 0.5, quick=False))
    monkeypatch.setattr(validate, "ALL_CLAIMS", made)


def mmslam(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["validate", *arguments])
    return result.exit_code, result.stdout, result.stderr


def test_a_figure_beyond_its_limit_fails_the_command() -> None:
    code, told, _ = mmslam("--quick")
    assert code == 1
    assert "1 of 2 figures within their limits; failed: bad" in told
    assert mmslam("--only", "good")[0] == 0


def test_the_document_alone_is_on_stdout() -> None:
    code, told, _ = mmslam("--quick", "--json")
    assert code == 1
    document = json.loads(told)
    assert [one["key"] for one in document["claims"]] == ["good", "bad"]
    assert not document["passed"]


def test_the_claims_are_listed_with_their_forms() -> None:
    code, told, _ = mmslam("--list")
    assert code == 0
    assert [line.split()[0] for line in told.splitlines()] == ["good", "bad", "slow"]
    assert "full only" in told.splitlines()[2]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "other"), "--only other: no such claim; known: good, bad, slow"),
        (("--quick", "--only", "slow"), "--only slow: it has no quick form; leave --quick out"),
        (
            ("--only", "good", "--record", "docs"),
            "--record docs: keeps all claims",
        ),
        (("--only", "good", "--against", "docs"), "--against docs: no full.json there"),
    ],
)
def test_what_cannot_be_asked_for_is_refused(arguments: tuple[str, ...], message: str) -> None:
    code, _, told = mmslam(*arguments)
    assert code == 2
    assert message in told


def test_refusals_come_before_anything_is_measured(tmp_path: Path) -> None:
    assert mmslam("--against", "docs")[0] == 2
    assert not (tmp_path / "out").exists()


def test_a_foreign_folder_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("")
    code, _, told = mmslam("--out", "mine")
    assert code == 2
    assert "mine: holds files that `mmslam validate` did not write" in told


def test_stated_figures_that_no_longer_hold_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    assert mmslam("--quick", "--record", "docs")[0] == 1
    monkeypatch.setattr(validate, "ALL_CLAIMS", (claim("good", 0.8),))
    code, told, _ = mmslam("--quick", "--against", "docs", "--fresh")
    assert code == 1
    assert "no longer holds: good, length: stated as 0.5 m, measured 0.8 m" in told


def test_an_interrupted_run_says_how_to_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validate, "ALL_CLAIMS", (claim("good", 0.5), claim("stopped", -1.0)))
    code, _, told = mmslam("--quick", "--out", "here")
    assert code == 130
    assert "1 of 2 claims are kept in here: the same command goes on" in told
