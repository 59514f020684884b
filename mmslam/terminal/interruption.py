"""Ctrl-C (SIGINT), delayed until the program can stop without losing or damaging anything.

A KeyboardInterrupt raised inside a C++ library (an import of Mitsuba, a kernel of Dr.Jit that
calls back into Python) may be replaced by another exception or abort the whole process, and then
no ``finally`` block runs.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


class ResumableInterruption(KeyboardInterrupt):
    """Ctrl-C interrupted work that can be resumed; the message says how."""


@contextmanager
def interruptions_held() -> Iterator[Callable[[], None]]:
    """Delay Ctrl-C to the end of the block; pressed a second time, it takes effect at once.

    Yields
    ------
    Function that raises a delayed interruption: call it at places where stopping is safe.

    Raises
    ------
    KeyboardInterrupt
        At the end of the block, or by that function, if Ctrl-C was pressed; at once if it was
        pressed twice.
    """
    presses = 0

    def hold(number: int, frame: FrameType | None) -> None:
        nonlocal presses
        presses += 1
        if presses > 1:
            raise KeyboardInterrupt

    def let_through() -> None:
        if presses:
            raise KeyboardInterrupt

    with _handler(hold):
        yield let_through
    let_through()


@contextmanager
def interruptions_noted() -> Iterator[Callable[[], bool]]:
    """Record that Ctrl-C was pressed, even if a library replaces the KeyboardInterrupt.

    Yields
    ------
    Function that tells whether it was.
    """
    pressed = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        pressed = True
        raise KeyboardInterrupt

    with _handler(note):
        yield lambda: pressed


@contextmanager
def _handler(handle: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread is interrupted, and only it may set handlers
        return
    before = signal.getsignal(signal.SIGINT)
    if before == signal.SIG_IGN:  # as for a job in the background
        yield
        return
    signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
