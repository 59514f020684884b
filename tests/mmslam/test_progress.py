import io

import pytest
from rich.console import Console

from mmslam.progress import StageProgress


def shown(*, terminal: bool, seconds: float, monkeypatch: pytest.MonkeyPatch) -> str:
    clock = iter(seconds / 4 * step for step in range(100))
    monkeypatch.setattr("time.monotonic", lambda: next(clock))
    written = io.StringIO()
    console = Console(file=written, force_terminal=terminal, width=80)
    with StageProgress(console) as report:
        for done in range(1, 6):
            report("echo", done, 5)
    return written.getvalue()


def test_a_stage_of_less_than_a_second_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(terminal=True, seconds=0.9, monkeypatch=monkeypatch) == ""
    assert shown(terminal=False, seconds=0.9, monkeypatch=monkeypatch) == ""


def test_a_longer_stage_shows_a_bar_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "echo" in shown(terminal=True, seconds=4.0, monkeypatch=monkeypatch)


def test_a_longer_stage_leaves_one_line_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(terminal=False, seconds=4.0, monkeypatch=monkeypatch) == "echo: 4.0 s\n"
