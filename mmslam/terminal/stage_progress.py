"""Progress on stderr, and only for what takes more than a second."""

import threading
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

PATIENCE = 1.0
"""A stage that ends sooner shows nothing [s]."""


class StageProgress:
    """Callable that shows the bar of a stage once it has taken :data:`PATIENCE`.

    A timer shows it, not the next step: a step may take long itself. Bars are drawn only on
    a terminal; elsewhere each such stage leaves one line.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._lock = threading.Lock()
        self._stage: str | None = None
        self._started = 0.0
        self._steps = (0, 1)  # done, in all
        self._timer: threading.Timer | None = None
        self._bar: Progress | None = None

    def __enter__(self) -> "StageProgress":
        """Show nothing yet."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        self._end()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Note that ``done`` of ``total`` steps of a stage are done."""
        if stage != self._stage:
            self._end()
            self._begin(stage)
        with self._lock:
            self._steps = (done, total)
            if self._bar is not None:
                self._bar.update(self._bar.task_ids[0], completed=done, total=total)
        if done >= total:
            took = time.monotonic() - self._started
            self._end()
            if took >= PATIENCE and not self._console.is_terminal:
                self._console.print(f"{stage}: {took:.1f} s", markup=False, highlight=False)

    def _begin(self, stage: str) -> None:
        self._stage, self._started = stage, time.monotonic()
        if self._console.is_terminal:
            self._timer = threading.Timer(PATIENCE, self._show, args=(stage,))
            self._timer.daemon = True
            self._timer.start()

    def _show(self, stage: str) -> None:
        with self._lock:
            if stage != self._stage:  # ended in the meantime
                return
            self._bar = Progress(
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                TextColumn("{task.completed} of {task.total}"),
                TimeElapsedColumn(),
                console=self._console,
                transient=True,
            )
            done, total = self._steps
            self._bar.add_task(stage, completed=done, total=total)
            self._bar.start()

    def _end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        with self._lock:
            self._stage, self._timer = None, None
            if self._bar is not None:
                self._bar.stop()
                self._bar = None
