"""Ctrl-C where it can be borne.

An exception that arises inside a C++ library (an import of Mitsuba, a kernel of Dr.Jit that
calls back into Python) may come out as another one, or abort the whole process, and then
nothing is tidied up.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


class ResumableInterruption(KeyboardInterrupt):
    """Ctrl-C came while something was made that can be gone on with; the message says how."""


@contextmanager
def interruptions_held() -> Iterator[Callable[[], None]]:
    """Hold Ctrl-C back until the block ends; pressed twice, it comes at once.

    Yields
    ------
    Function that lets a held interruption through: call it where one can be borne.

    Raises
    ------
    KeyboardInterrupt
        At the end of the block, or by that function, if Ctrl-C was pressed.
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
    """Remember that Ctrl-C was pressed, whatever exception becomes of it on its way.

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
