import io

import pytest
from rich.console import Console

from mmslam.terminal.task_progress import WorkProgress, told_size, told_time


def test_without_a_terminal_progress_is_lines_with_rate_and_time_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = iter([0.0, 10.0, 60.0, 120.0])
    monkeypatch.setattr("mmslam.terminal.task_progress.time.monotonic", lambda: next(now))
    console = Console(file=io.StringIO(), width=200)
    with WorkProgress("samples", console) as progress:
        progress(100, 0, 220)  # taken up again
        progress(110, 0, 220)  # too soon for a line
        progress(160, 1, 220)  # 60 in a minute
        progress(220, 1, 220)
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue().splitlines() == [
        "samples: 160 of 220 done, 1 failed, 60.0/min, 1 min left",
        "samples: 220 of 220 done, 1 failed, 60.0/min",
    ]


def test_on_a_terminal_progress_is_a_bar() -> None:
    console = Console(file=io.StringIO(), width=200, force_terminal=True)
    with WorkProgress("samples", console) as progress:
        progress(0, 0, 10)
        progress(5, 2, 10)
    assert isinstance(console.file, io.StringIO)
    assert "5 of 10, 2 failed" in console.file.getvalue()


@pytest.mark.parametrize(
    ("seconds", "told"),
    [(2.34, "2.3 s"), (59.0, "59 s"), (90.0, "2 min"), (7500.0, "2 h 5 min"), (3e5, "3 d 11 h")],
)
def test_durations_can_be_read(seconds: float, told: str) -> None:
    assert told_time(seconds) == told


@pytest.mark.parametrize(
    ("size", "told"), [(100, "100 B"), (1536, "1.5 KiB"), (3 * 2**40, "3 TiB")]
)
def test_sizes_can_be_read(size: int, told: str) -> None:
    assert told_size(size) == told
