"""Commands that are killed, or run out of space, at any step lose nothing and end the same.

Run as ``python -m benchmarks.kill_points [--case NAME] [--points N]``. Each case writes an output
where an earlier one lies. It is first run in peace, counting its steps: each file that is opened
for writing, renamed, removed or linked, each folder that is made or removed, each exchange of two
names. Then, for each step k of a copy:

kill    SIGKILL before step k;
torn    from step k on, the first write beyond 64 bytes of a file ends the process in its middle;
full    from step k on, nothing that takes space can be made (ENOSPC), until the command has ended;
frozen  from step k on, nothing at all can be changed (EROFS: a file system that the kernel has made
        read-only), until the command has ended.

After that the earlier output must be there, or the new one, whole; and the same command, run in
peace, must end with the bytes of the first one and leave nothing beside them.

Only files are at stake: what takes long (a simulation, an estimate, figures) is computed once.
"""

import argparse
import errno
import filecmp
import os
import resource
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.kill_cases import Case, cases
from estimator.measurement import atomic_rename

Mode = str  # "kill", "torn", "full", "frozen"
MODES = ("kill", "torn", "full", "frozen")

_SPACE = ("open", "os.mkdir", "os.link", "os.symlink")  # events of steps that take space
_STEPS = (*_SPACE, "os.rename", "os.remove", "os.rmdir", "mmslam.renameat2")
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
_TORN = 64  # bytes


class Steps:
    """Counts the steps that a process takes in a folder, and fails one."""

    def __init__(self, folder: Path, fails_at: int | None, mode: Mode) -> None:
        self.count = 0
        self._folder, self._fails_at, self._mode = str(folder), fails_at, mode
        self._failing = False

    def watch(self) -> None:
        """Listen to what Python tells of its system calls, for the rest of this process."""
        really = atomic_rename._renameat2

        def told(one: Path, other: Path, flags: int) -> bool:
            sys.audit("mmslam.renameat2", str(one))
            return really(one, other, flags)

        atomic_rename._renameat2 = told
        sys.addaudithook(self._heard)

    def _heard(self, event: str, arguments: tuple[object, ...]) -> None:
        if event not in _STEPS or not self._is_step(event, arguments):
            return
        self.count += 1
        if self.count == self._fails_at:
            if self._mode == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            if self._mode == "torn":
                resource.setrlimit(resource.RLIMIT_FSIZE, (_TORN, _TORN))
            self._failing = self._mode in ("full", "frozen")
        if self._failing and self._mode == "frozen":
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        if self._failing and event in _SPACE:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _is_step(self, event: str, arguments: tuple[object, ...]) -> bool:
        path = arguments[0]
        if not isinstance(path, str | bytes | os.PathLike):
            return False
        if not os.fsdecode(path).startswith(self._folder):
            return False
        if event != "open":
            return True
        mode, flags = arguments[1], arguments[2]
        if isinstance(mode, str):
            return any(sign in mode for sign in "wax+")
        return isinstance(flags, int) and bool(flags & _WRITING)


def in_a_process_of_its_own(run: Callable[[], None]) -> int:
    """Run something in a fork, and return its status as ``waitpid`` tells it."""
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            with open(os.devnull, "w") as nowhere:
                os.dup2(nowhere.fileno(), 1)
                os.dup2(nowhere.fileno(), 2)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
            run()
            code = 0
        except BaseException as error:
            code = 2 if isinstance(error, ValueError | OSError) else 3
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1]


def run_case(case: Case, points: int | None, told: Callable[[str], None] = print) -> int:
    """Run a case under all attacks; return how many there were.

    Parameters
    ----------
    case
        What is run.
    points
        How many steps of each mode are tried, evenly over all; None: every one.
    told
        Is told what each mode has come to.

    Raises
    ------
    AssertionError
        If something was lost, refused, left over or not the same.
    """
    attacks = 0
    with tempfile.TemporaryDirectory() as name:
        top = Path(name).resolve()
        peace = top / "peace"
        _prepare(case, peace)
        before = _copy(peace, top / "before")
        steps = _steps_in_peace(case, peace)
        for mode in MODES:
            tried = list(range(1, steps + 1))
            if points is not None and points < steps:
                tried = sorted({round(at) for at in np.linspace(1, steps, points)})
            for at in tried:
                folder = _copy(before, top / "attacked")
                status = in_a_process_of_its_own(partial(_attacked, case, folder, at, mode))
                what = f"{case.name}, {mode} at step {at} of {steps}"
                assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) in (0, 2), (
                    f"{what}: ended with status {status}"
                )
                _check_nothing_lost(case, folder, before, peace, what)
                again = in_a_process_of_its_own(partial(case.run, folder))
                assert again == 0, f"{what}: the same command then ended with status {again}"
                assert not (found := differing(folder, peace)), f"{what}: {found}"
                shutil.rmtree(folder)
                attacks += 1
            told(f"{case.name}: {len(tried)} of {steps} steps, {mode}: nothing lost, same bytes")
    return attacks


def differing(one: Path, other: Path) -> list[str]:
    """Return what differs between two folders: what only one has, or with other bytes."""
    names = [{str(p.relative_to(top)) for p in top.rglob("*")} for top in (one, other)]
    both = {name for name in names[0] & names[1] if (one / name).is_file()}
    wrong = [name for name in sorted(both) if not _same(one / name, other / name)]
    return sorted(names[0] ^ names[1]) + wrong


def _same(one: Path, other: Path) -> bool:
    """Compare two files by their bytes; NetCDF's library writes when a file was made into it."""
    if other.suffix == ".nc":
        return _content(one) == _content(other)
    return filecmp.cmp(one, other, shallow=False)


def _content(file: Path) -> dict[str, bytes]:
    import netCDF4

    with netCDF4.Dataset(file, auto_complex=True) as read:
        return {name: repr(read[name][...].tolist()).encode() for name in read.variables}


def _prepare(case: Case, folder: Path) -> None:
    folder.mkdir()
    if case.earlier:
        assert in_a_process_of_its_own(lambda: case.run(folder)) == 0, f"{case.name} cannot run"
        mark = next(p for p in sorted((folder / case.output).rglob("*")) if p.suffix == ".html")
        mark.write_text("earlier")


def _steps_in_peace(case: Case, folder: Path) -> int:
    counted = folder.parent / "steps"

    def run() -> None:
        steps = Steps(folder, None, "")
        steps.watch()
        case.run(folder)
        counted.write_text(str(steps.count))

    status = in_a_process_of_its_own(run)
    assert status == 0, f"{case.name}: ended with status {status} in peace"
    return int(counted.read_text())


def _attacked(case: Case, folder: Path, at: int, mode: Mode) -> None:
    Steps(folder, at, mode).watch()
    case.run(folder)


def _check_nothing_lost(case: Case, folder: Path, before: Path, peace: Path, what: str) -> None:
    """See that the output is the earlier one, or none if there was none, or the new one."""
    place = folder / case.output
    if not place.exists():
        assert not case.earlier, f"{what}: the earlier output is gone"
        return
    if place.is_file():
        assert _same(place, peace / case.output), f"{what}: half-written"
        return
    new = differing(place, peace / case.output)
    earlier = not case.earlier or differing(place, before / case.output)
    assert not new or not earlier, f"{what}: half-written: {new}"


def _copy(source: Path, target: Path) -> Path:
    return Path(shutil.copytree(source, target, symlinks=True))


@contextmanager
def inputs_folder() -> Iterator[Path]:
    """Give a folder for the cases' inputs."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name).resolve() / "inputs"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the cases."""
    parser = argparse.ArgumentParser(description="Commands killed at every step lose nothing.")
    parser.add_argument("--case", action="append", help="one case alone; repeatable")
    parser.add_argument("--points", type=int, help="steps of each mode and case [all]")
    chosen = parser.parse_args(arguments)
    attacks = 0
    with inputs_folder() as inputs:
        for case in list(cases(inputs)):
            if chosen.case is None or case.name in chosen.case:
                attacks += run_case(case, chosen.points)
    print(f"{attacks} attacks")
    return 0


if __name__ == "__main__":
    sys.exit(main())
