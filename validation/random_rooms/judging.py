"""Rooms drawn, simulated, located and scored, several at a time; what is done is kept."""

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
    """Answer random rooms, and score the answers.

    Parameters
    ----------
    kind
        The set of rooms: a key of :data:`validation.random_rooms.prior.SETS`.
    numbers
        Of the rooms in their set.
    purpose
        Rooms to tune on, or to judge by.
    workers
        Processes that share the rooms, each of one thread; 1: this one, of all threads.
    keep
        A folder for the simulated measurements, so that they are simulated once: the code that
        simulates must not change between.
    tell
        Told the rooms done, and how many there are.

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
    """Answer one random room and score the answer; see :func:`judge_rooms`."""
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
    """Score an estimate of a room of one user; the oracle is asked if it was not before."""
    (uplink,) = measurement.uplinks
    asked = oracle or ask_oracle(scenario, USER, measurement.echo, uplink, truth)
    return score_room(
        scenario.name, estimate, truth, asked, flat=scenario.dimensions == 2, seconds=seconds
    )


def measured_room(
    scenario: Scenario, number: int, *, purpose: Purpose, keep: Path | None = None
) -> tuple[Measurement, Truth]:
    """Simulate a random room, or read what was simulated before."""
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
    # Dr.Jit's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    with context.Pool(workers, initializer=compute_in_one_thread) as pool:
        yield from pool.imap(judge, numbers)


def write_scores(path: Path, scores: Sequence[RoomScore]) -> None:
    """Keep scores as JSON, one room a line."""
    lines = ",\n".join(json.dumps(asdict(score)) for score in scores)
    path.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
