"""Exit codes: bad input gives one message and 2, Ctrl-C gives 130; a bug keeps its traceback."""

import contextlib
import errno
import os
import sys
from collections.abc import Iterator

import typer

from mmslam.plain_text import message
from mmslam.terminal.interruption import ResumableInterruption, interruptions_noted

FALLS_SHORT = 1
BAD_INPUT = 2
INTERRUPTED = 130


# OS errors caused by the name or place of a file given by the user; other errors are bugs.
_OF_THE_PLACE = frozenset(
    {
        errno.EACCES,
        errno.EDQUOT,
        errno.EIO,
        errno.ELOOP,
        errno.ENAMETOOLONG,
        errno.ENOSPC,
        errno.EPERM,
        errno.EROFS,
        errno.ESTALE,
    }
)


@contextlib.contextmanager
def told_clearly() -> Iterator[None]:
    """Turn bad input into its message and exit code 2, Ctrl-C into exit code 130."""
    with interruptions_noted() as interrupted:
        try:
            yield
        except (Exception, KeyboardInterrupt) as error:
            if interrupted() or isinstance(error, KeyboardInterrupt):
                resumable = isinstance(error, ResumableInterruption)
                _say(str(error) if resumable else "interrupted; nothing was written")
                raise typer.Exit(INTERRUPTED) from None
            if isinstance(error, OSError) and error.errno in _OF_THE_PLACE:
                _say(f"error: {error.filename or 'a file'}: {error.strerror}; choose another one")
            elif isinstance(error, _users_errors()):
                _say(f"error: {error}")
            else:
                raise
            raise typer.Exit(BAD_INPUT) from None


@contextlib.contextmanager
def stdout_kept_clean() -> Iterator[None]:
    """Redirect stdout to stderr within the block, for C++ libraries too.

    Mitsuba and LLVM write to the file descriptor, which no replacement of ``sys.stdout``
    reaches.
    """
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def _say(text: str) -> None:
    typer.echo(message(f"mmslam: {text}"), err=True)


def _users_errors() -> tuple[type[Exception], ...]:
    # Imported here: only a failure pays for pydantic and jaxtyping.
    from estimator.compute.engine import EngineError
    from estimator.measurement.model import MeasurementError
    from mmslam.output import OutputError
    from scenes.scenario import ScenarioError

    return EngineError, MeasurementError, OutputError, ScenarioError
