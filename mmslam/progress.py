"""Progress on stderr, and only for what takes more than a second."""

import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

PATIENCE = 1.0
"""A stage that ends sooner shows no bar. [s]"""


class StageProgress:
    """Callable that shows the bar of a stage once it has taken :data:`PATIENCE`.

    Bars are drawn only on a terminal; elsewhere each such stage leaves one line.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._bars: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._started: dict[str, float] = {}

    def __enter__(self) -> "StageProgress":
        """Show nothing yet."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bars away."""
        if self._bars is not None:
            self._bars.stop()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Note that ``done`` of ``total`` steps of a stage are done."""
        now = time.monotonic()
        took = now - self._started.setdefault(stage, now)
        if took < PATIENCE:
            return
        if not self._console.is_terminal:
            if done >= total:
                self._console.print(f"{stage}: {took:.1f} s", markup=False, highlight=False)
            return
        if self._bars is None:
            self._bars = Progress(
                TextColumn("{task.description:<24}", markup=False),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f} %"),
                TimeRemainingColumn(),
                console=self._console,
                transient=True,
            )
            self._bars.start()
        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(stage, total=total)
        self._bars.update(self._tasks[stage], completed=done, total=total)
