import contextlib
import importlib
import os
import signal
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from simulator.dataset import task_runner
from simulator.dataset.task_runner import Result, Task, WorkError, Workers, work_off


def square(number: int) -> int:
    if number == 3:
        raise ZeroDivisionError("three")
    return number**2


def die_once(mark: Path) -> str:
    """Kill the own process, as a full memory does; the next one that tries lives."""
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "alive"


def die() -> None:
    """Kill the own process each time, as a sample that never fits into memory does."""
    os.kill(os.getpid(), signal.SIGKILL)


def threads() -> int:
    import drjit as dr

    return int(dr.thread_count())


@pytest.mark.parametrize("processes", [0, 2])
def test_every_task_is_done_once_and_failures_are_told(processes: int, tmp_path: Path) -> None:
    found: dict[str, Result] = {}
    most_ahead = 0
    drawn = 0

    def tasks() -> Iterator[Task]:
        nonlocal drawn
        for number in range(40):
            drawn += 1
            yield Task(name=f"square-{number}", function=square, arguments=(number,))

    def on_result(task: Task, result: Result) -> Iterable[Task]:
        nonlocal most_ahead
        assert task.name not in found
        found[task.name] = result
        most_ahead = max(most_ahead, drawn - len(found))
        if task.name == "square-5":
            return [
                Task(name="more", function=threads),
                Task(name="die", function=die_once, arguments=(tmp_path / "mark",)),
            ]
        return []

    if processes == 0:
        (tmp_path / "mark").touch()  # this process shall live
    began = time.monotonic()
    work_off(tasks(), workers=Workers(processes=processes), on_result=on_result)
    assert time.monotonic() - began < 60
    assert len(found) == 42
    assert isinstance(found["square-3"], ZeroDivisionError)
    assert found["square-39"] == 1521
    assert found["die"] == "alive"
    assert most_ahead <= 2 * max(processes, 1)  # never all tasks at once
    if processes:
        assert found["more"] == 1  # each worker computes in one thread


def test_a_task_that_kills_each_worker_ends_as_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task_runner, "DEATHS", 1)
    found: dict[str, Result] = {}

    def on_result(task: Task, result: Result) -> Iterable[Task]:
        found[task.name] = result
        return []

    tasks = [
        Task(name="die-0", function=die),
        *(Task(name=f"square-{i}", function=square, arguments=(i,)) for i in (1, 2)),
    ]
    work_off(tasks, workers=Workers(processes=1), on_result=on_result)
    assert type(found["die-0"]).__name__ == "KilledWorker"
    # What waited in a worker that died may be taken for the cause as well; the next run does it.
    for number in (1, 2):
        result = found[f"square-{number}"]
        assert result == number**2 or type(result).__name__ == "KilledWorker"


def test_a_scheduler_of_somebody_else_does_the_work() -> None:
    found: dict[str, Result] = {}

    def on_result(task: Task, result: Result) -> Iterable[Task]:
        found[task.name] = result
        return [Task(name="threads", function=threads)] if task.name == "square-4" else []

    tasks = (Task(name=f"square-{i}", function=square, arguments=(i,)) for i in range(20))
    distributed: Any = importlib.import_module("distributed")  # half its annotations are missing
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        dashboard_address=None,
        scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
    ) as cluster:
        work_off(tasks, workers=Workers(scheduler=cluster.scheduler_address), on_result=on_result)
        # It is not ours to end: the next run finds it there.
        work_off(
            [Task(name="again", function=square, arguments=(9,))],
            workers=Workers(scheduler=cluster.scheduler_address),
            on_result=on_result,
        )
    assert isinstance(found.pop("square-3"), ZeroDivisionError)
    assert (found.pop("threads"), found.pop("again")) == (1, 81)
    assert found == {f"square-{i}": i**2 for i in range(20) if i != 3}


def test_a_scheduler_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task_runner, "CONNECTING", 0.5)
    workers = Workers(scheduler="tcp://127.0.0.1:9")  # the port 'discard': nobody listens
    task = Task(name="square-1", function=square, arguments=(1,))
    with pytest.raises(WorkError, match=r"--scheduler tcp://127\.0\.0\.1:9: cannot be reached"):
        work_off([task], workers=workers, on_result=lambda task, result: [])


def the_address() -> str:
    distributed: Any = importlib.import_module("distributed")
    return str(distributed.get_worker().scheduler.address)


def listening(parent: int) -> dict[str, list[str]]:
    """Return the addresses where a process and its children listen, as `ss -ltn` would."""
    family = {parent}
    entries = [entry for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    for entry in sorted(entries, key=lambda entry: int(entry.name)):
        with contextlib.suppress(OSError):
            above = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if above in family:
                family.add(int(entry.name))
    inodes = set()
    for process in family:
        with contextlib.suppress(OSError):
            for file in (Path("/proc") / str(process) / "fd").iterdir():
                with contextlib.suppress(OSError):
                    inodes.add(os.readlink(file).removeprefix("socket:[").removesuffix("]"))
    found: dict[str, list[str]] = {"loopback": [], "elsewhere": []}
    for table, loopback in (("tcp", "0100007F"), ("tcp6", "0" * 24 + "01000000")):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:  # LISTEN
                host = fields[1].partition(":")[0]
                found["loopback" if host == loopback else "elsewhere"].append(fields[1])
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_nobody_else_can_use_our_workers() -> None:
    distributed: Any = importlib.import_module("distributed")
    refusals: list[str] = []
    sockets: dict[str, list[str]] = {}

    def on_result(task: Task, result: Result) -> Iterable[Task]:
        address = str(result)
        assert address.startswith("tls://127.0.0.1:")
        sockets.update(listening(os.getpid()))
        strangers = {
            "without encryption": (address.replace("tls://", "tcp://"), None),
            "without certificate": (address, None),
            "with a certificate of its own": (address, distributed.Security.temporary()),
        }
        for name, (where, security) in strangers.items():
            try:
                distributed.Client(where, security=security, timeout=2, set_as_default=False)
            except (OSError, TypeError, TimeoutError):
                refusals.append(name)
        return []

    work_off(
        [Task(name="address", function=the_address)],
        workers=Workers(processes=1),
        on_result=on_result,
    )
    assert refusals == [
        "without encryption",
        "without certificate",
        "with a certificate of its own",
    ]
    assert len(sockets["loopback"]) >= 2  # of scheduler and worker: the test sees sockets at all
    assert sockets["elsewhere"] == []


def test_a_scheduler_that_wants_a_certificate_is_not_asked_without_one() -> None:
    task = Task(name="square-1", function=square, arguments=(1,))
    workers = Workers(scheduler="tls://127.0.0.1:9")
    with pytest.raises(WorkError, match="Dask has no certificate for it"):
        work_off([task], workers=workers, on_result=lambda task, result: [])
