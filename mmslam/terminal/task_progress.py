"""Progress of many tasks on stderr: done, failed, rate, time left."""

import time
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

BETWEEN_LINES = 30.0
"""Time between two lines where no bar can be drawn: in a file, in CI. [s]"""

_WINDOW = 300.0  # what the time left is judged by [s]


class _Rate(ProgressColumn):
    def render(self, task: Task) -> Text:
        """Show tasks per minute, once it can be said."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{60 * speed:.1f}/min")


class WorkProgress:
    """Callable that shows how many tasks are done, have failed, and there are in all."""

    def __init__(self, what: str, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._what = what
        self._bar: Progress | None = None
        self._began: tuple[float, int] | None = None  # when, and what was done then
        self._told = 0.0

    def __enter__(self) -> "WorkProgress":
        """Show nothing yet."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, done: int, failed: int, total: int) -> None:
        """Note that ``done`` of ``total`` tasks are done, of which ``failed`` have failed."""
        now = time.monotonic()
        if self._began is None:
            self._began = now, done
            self._told = now
        if self._console.is_terminal:
            self._draw(done, failed, total)
        elif now - self._told >= BETWEEN_LINES or (done == total and done > self._began[1]):
            self._told = now
            self._console.print(self._line(now, done, failed, total), markup=False, highlight=False)

    def _draw(self, done: int, failed: int, total: int) -> None:
        if self._bar is None:
            self._bar = Progress(
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                TextColumn("{task.completed} of {task.total}{task.fields[failed]}", markup=False),
                _Rate(),
                TimeRemainingColumn(),
                console=self._console,
                transient=True,
                speed_estimate_period=_WINDOW,
            )
            self._bar.add_task(self._what, completed=done, total=total, failed="")
            self._bar.start()
        told = f", {failed} failed" if failed else ""
        self._bar.update(self._bar.task_ids[0], completed=done, total=total, failed=told)

    def _line(self, now: float, done: int, failed: int, total: int) -> str:
        assert self._began is not None
        began, before = self._began
        made, took = done - before, max(now - began, 1e-9)
        line = f"{self._what}: {done} of {total} done, {failed} failed, {60 * made / took:.1f}/min"
        if made and done < total:
            line += f", {told_time((total - done) * took / made)} left"
        return line


def told_time(seconds: int | float) -> str:
    """Say a duration so that it can be read: ``"3 h 20 min"``."""
    if seconds < 60:
        return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"
    minutes = round(seconds / 60)
    if minutes < 60:
        return f"{minutes} min"
    hours, minutes = divmod(minutes, 60)
    if hours < 48:
        return f"{hours} h {minutes} min"
    return f"{hours // 24} d {hours % 24} h"


def told_size(size: int | float) -> str:
    """Say a number of bytes so that it can be read: ``"1.5 GiB"``."""
    units = ("B", "KiB", "MiB", "GiB", "TiB", "PiB")
    power = 0
    while size >= 1024 and power < len(units) - 1:
        size, power = size / 1024, power + 1
    return f"{size:.0f} {units[power]}" if power == 0 else f"{size:.3g} {units[power]}"
