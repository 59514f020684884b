"""Random rooms: drawn, simulated, located and scored, with several workers and a cache."""

import json
import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from estimator.localization.pipeline import locate
from estimator.measurement.model import Measurement
from estimator.measurement.store import read_measurement, write_measurement
from estimator.results.estimate import Estimate
from scenes.scenario import Scenario
from simulator.dataset.task_runner import compute_in_one_thread
from simulator.simulation import simulate
from validation.metrics.truth import Truth, read_truth, truth_from_dataset
from validation.random_rooms.oracle import Answerable, ask_oracle
from validation.random_rooms.prior import SEEDS, USER, Purpose, draw_room
from validation.random_rooms.room_score import RoomScore, score_room


def judge_rooms(
    kind: str,
    numbers: Sequence[int],
    *,
    purpose: Purpose,
    workers: int = 1,
    keep: Path | None = None,
    tell: Callable[[int, int], None] = lambda done, count: None,
) -> tuple[RoomScore, ...]:
    """Locate the users of random rooms, and score the estimates.

    Parameters
    ----------
    kind
        The set of rooms: a key of :data:`validation.random_rooms.prior.SETS`.
    numbers
        Of the rooms in their set.
    purpose
        Rooms to tune on, or to judge by.
    workers
        Processes with one thread each; 1: this process, with all threads.
    keep
        Cache of simulated measurements; invalid if the simulator's code has changed.
    tell
        Called with the numbers of rooms done and in all.

    Returns
    -------
    The scores, in the order of the numbers.
    """
    judge = partial(judge_room, kind, purpose=purpose, keep=keep)
    scores = []
    for score in _each(judge, numbers, workers):
        scores.append(score)
        tell(len(scores), len(numbers))
    return tuple(scores)


def judge_room(kind: str, number: int, *, purpose: Purpose, keep: Path | None = None) -> RoomScore:
    """Locate the user of one random room and score the estimate; see :func:`judge_rooms`."""
    scenario = draw_room(kind, number, purpose=purpose)
    measurement, truth = measured_room(scenario, number, purpose=purpose, keep=keep)
    started = time.perf_counter()
    estimate = locate(measurement)
    seconds = time.perf_counter() - started
    return scored(scenario, measurement, truth, estimate, seconds=seconds)


def scored(
    scenario: Scenario,
    measurement: Measurement,
    truth: Truth,
    estimate: Estimate,
    *,
    seconds: float,
    oracle: Answerable | None = None,
) -> RoomScore:
    """Score an estimate in a room of one user; the oracle is run if its result is not given."""
    (uplink,) = measurement.uplinks
    asked = oracle or ask_oracle(scenario, USER, measurement.echo, uplink, truth)
    return score_room(
        scenario.name, estimate, truth, asked, flat=scenario.dimensions == 2, seconds=seconds
    )


def measured_room(
    scenario: Scenario, number: int, *, purpose: Purpose, keep: Path | None = None
) -> tuple[Measurement, Truth]:
    """Simulate a random room, or read its measurement from the cache."""
    store = None if keep is None else keep / f"{scenario.name}.zarr"
    if store is not None and store.exists():
        return read_measurement(store), read_truth(store)
    simulated = simulate(scenario, seed=SEEDS[purpose], sample=number)
    if store is not None:
        write_measurement(store, simulated.measurement, truth=simulated.truth)
    return simulated.measurement, truth_from_dataset(simulated.truth)


def _each(
    judge: Callable[[int], RoomScore], numbers: Sequence[int], workers: int
) -> Iterator[RoomScore]:
    if workers == 1:
        yield from map(judge, numbers)
        return
    # Spawned, not forked: Dr.Jit's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    with context.Pool(workers, initializer=compute_in_one_thread) as pool:
        yield from pool.imap(judge, numbers)


def write_scores(path: Path, scores: Sequence[RoomScore]) -> None:
    """Write scores as JSON, one room per line."""
    lines = ",\n".join(json.dumps(asdict(score)) for score in scores)
    path.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
