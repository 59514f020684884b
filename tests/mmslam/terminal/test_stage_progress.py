import io
import time

import pytest
from rich.console import Console

from mmslam.terminal import stage_progress
from mmslam.terminal.stage_progress import StageProgress


def shown(*, terminal: bool, step: float) -> str:
    """Run a stage of two steps, the first of which takes ``step`` seconds."""
    written = io.StringIO()
    console = Console(file=written, force_terminal=terminal, width=80)
    with StageProgress(console) as report:
        report("echo", 0, 2)
        time.sleep(step)
        report("echo", 1, 2)
        report("echo", 2, 2)
    return written.getvalue()


def test_a_stage_of_less_than_a_second_shows_nothing() -> None:
    assert shown(terminal=True, step=0.01) == ""
    assert shown(terminal=False, step=0.01) == ""


def test_a_longer_stage_shows_a_bar_even_within_its_first_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stage_progress, "PATIENCE", 0.05)
    text = shown(terminal=True, step=0.5)
    assert "echo" in text
    assert "0 of 2" in text


def test_a_longer_stage_leaves_one_line_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage_progress, "PATIENCE", 0.05)
    text = shown(terminal=False, step=0.1)
    assert text.startswith("echo: ")
    assert text.count("\n") == 1


def test_an_interrupted_stage_leaves_no_bar_and_no_thread_behind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import threading

    monkeypatch.setattr(stage_progress, "PATIENCE", 0.05)
    before = threading.active_count()

    def work() -> None:
        with StageProgress(Console(file=io.StringIO(), force_terminal=True)) as report:
            report("echo", 0, 2)
            time.sleep(0.2)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    time.sleep(0.1)
    assert threading.active_count() == before
