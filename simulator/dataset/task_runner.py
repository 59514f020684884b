"""Execution of tasks by Dask or in this process, a limited number at a time to bound memory.

This module keeps no record of what is done: files do, and an interrupted run resumes by submitting
the missing tasks. A worker that dies is replaced, and its task given to another.
"""

import functools
import importlib
import logging
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, cast

from threadpoolctl import threadpool_limits

PATIENCE = 60.0
"""Time for which an external scheduler may have no worker. [s]"""

CONNECTING = 10.0
"""Timeout of the connection to a scheduler. [s]"""

STARTING = "1 hour"
"""Time that a dead worker of this machine may take to restart, also when the machine is busy."""

DEATHS = 5
"""Number of workers that may die while at one task before it counts as failed. [-]"""


class WorkError(RuntimeError):
    """The work cannot continue; the message says why, and what to do."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """A call of a function that every worker can import."""

    name: str  # unique among all tasks of a run; up to its first '-' it names their kind
    function: Callable[..., Any]
    arguments: tuple[object, ...] = field(default=(), repr=False)


@dataclass(frozen=True, kw_only=True)
class Workers:
    """Where tasks are executed.

    Processes of this machine, those of a Dask scheduler, or (``processes`` = 0) this process.
    """

    processes: int = 0
    scheduler: str | None = None  # its address; then ``processes`` is ignored

    @property
    def in_this_process(self) -> bool:
        """Whether tasks run in this process, and no worker is started."""
        return self.scheduler is None and self.processes == 0


Result = object | Exception
"""What a task returned, or what it raised."""


def work_off(
    tasks: Iterable[Task],
    *,
    workers: Workers,
    on_result: Callable[[Task, Result], Iterable[Task]],
) -> None:
    """Execute tasks; with workers, this process only submits them and handles their results.

    Parameters
    ----------
    tasks
        Taken one by one as workers become free.
    workers
        Where they run. Each process computes in one thread.
    on_result
        Called with each result, in order of completion; returns tasks that are now possible. An
        exception that it raises ends the work.

    Raises
    ------
    WorkError
        If the scheduler cannot be reached, has no workers, or is lost meanwhile.
    """
    queue = _Queue(iter(tasks))
    if workers.in_this_process:
        while (task := queue.next()) is not None:
            queue.add(on_result(task, _result(task)))
        return
    as_completed = _distributed().as_completed
    with _client(workers) as client:
        running: dict[str, Task] = {}
        finished = as_completed(loop=client.loop)
        window = 0

        def submit() -> None:
            while len(running) < window and (task := queue.next()) is not None:
                future = client.submit(
                    _in_worker, task.function, task.arguments, key=task.name, pure=False
                )
                running[task.name] = task
                finished.add(future)

        window = _window(client) if workers.scheduler is not None else 2 * workers.processes
        submit()
        for count, future in enumerate(finished):
            task = running.pop(future.key)
            queue.add(on_result(task, _outcome(future)))
            future.release()
            if workers.scheduler is not None and count % 64 == 0:
                window = _window(client)  # a cluster grows and shrinks
            submit()


class _Queue:
    """Queue of tasks: those that became possible during the run go first."""

    def __init__(self, tasks: Iterator[Task]) -> None:
        self._tasks = tasks
        self._possible: deque[Task] = deque()

    def add(self, tasks: Iterable[Task]) -> None:
        self._possible.extend(tasks)

    def next(self) -> Task | None:
        return self._possible.popleft() if self._possible else next(self._tasks, None)


def _result(task: Task) -> Result:
    try:
        return cast(object, task.function(*task.arguments))
    except Exception as error:
        return error


def _outcome(future: Any) -> Result:
    if future.status == "finished":
        return cast(object, future.result())
    if future.status == "error":
        error = future.exception()
        assert isinstance(error, Exception)
        return error
    raise WorkError(
        f"the scheduler has lost a task ({future.status}); is it still there? The same command "
        "goes on where this one ended"
    )


def _window(client: Any) -> int:
    # Two for each thread: one running, one waiting.
    threads: int = sum(client.nthreads().values())
    return 2 * max(threads, 1)


@contextmanager
def _client(workers: Workers) -> Iterator[Any]:
    import dask

    distributed = _distributed()
    _quieten()
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS,
        # No pausing by memory: a paused worker never resumes if its tasks cannot free the memory.
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.pause": False,
        "distributed.admin.log-length": 100,
        "distributed.admin.low-level-log-length": 100,
        # Otherwise workers that restart slowly are given up one by one.
        "distributed.deploy.lost-worker-timeout": STARTING,
        # Some ports cannot be closed; they answer no requests.
        "distributed.scheduler.http.routes": [],
        "distributed.worker.http.routes": [],
    }
    with dask.config.set(settings):
        if workers.scheduler is not None:
            with _connected(workers.scheduler) as client:
                yield client
            return
        with (
            distributed.LocalCluster(
                n_workers=workers.processes,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                # A client that may submit a task runs code as this user, and any user of the
                # machine reaches the port: both ends need a certificate, kept in memory.
                security=distributed.Security.temporary(),
                dashboard_address=None,
                # Even without a dashboard it serves its health; the default port may be in use.
                scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                silence_logs=logging.CRITICAL,
                preload=[__name__],
            ) as cluster,
            distributed.Client(cluster, set_as_default=False) as client,
        ):
            yield client


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    try:
        client = _distributed().Client(address, timeout=CONNECTING, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise WorkError(
            f"--scheduler {address}: cannot be reached ({type(error).__name__}); give the address "
            "that `dask scheduler` prints, such as tls://10.0.0.1:8786"
        ) from error
    except TypeError as error:  # raised by Dask if a certificate is missing
        raise WorkError(
            f"--scheduler {address}: Dask has no certificate for it ({error}); name yours in "
            "Dask's configuration, distributed.comm.tls, as docs/how_to/cluster.md says"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError as error:
            raise WorkError(
                f"--scheduler {address}: has no worker after {PATIENCE:.0f} s; start some with "
                f"`dask worker {address} --nthreads 1`"
            ) from error
        yield client


def _distributed() -> Any:
    # Dask's annotations are incomplete; imported here, because it is slow and rarely needed.
    return importlib.import_module("distributed")


def _quieten() -> None:
    """Silence the cluster's own log messages: workers that die are expected and replaced."""
    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def _in_worker(function: Callable[..., Any], arguments: tuple[object, ...]) -> Any:
    compute_in_one_thread()
    return function(*arguments)


def dask_setup(worker: Any) -> None:
    """Let a worker of this machine ignore Ctrl-C, which a terminal sends to all processes.

    Dask calls it in each worker's main thread as it starts. The scheduling process handles Ctrl-C
    and stops the workers.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@functools.cache
def compute_in_one_thread() -> None:
    """Compute in one thread; by default Dr.Jit and BLAS take all cores in every worker."""
    threadpool_limits(limits=1, user_api="blas")
    from estimator.compute import engine

    if engine.backend() == "llvm":
        import drjit as dr

        dr.set_thread_count(1)
