"""Summary of the scores of many random rooms: right, wrong, ambiguous, missed and false answers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from validation.metrics.coverage import Coverage, coverage
from validation.random_rooms.room_score import CONFIDENT, RoomScore, Verdict

BINS = (0.0, 0.25, 0.5, 0.75, 0.9, 0.99, 0.999, 1.0)
"""Edges of the bins of stated probabilities. [-]"""


@dataclass(frozen=True, kw_only=True)
class Stated:
    """Positions with stated probabilities in one bin, and the number that were right."""

    low: float
    high: float
    places: int
    mean: float  # of the probabilities stated [-]
    right: int


@dataclass(frozen=True, kw_only=True)
class RoomSummary:
    """Counts of the answers to many rooms."""

    rooms: int
    verdicts: dict[Verdict, int]
    answerable: int  # rooms that the oracle answers
    answered: int  # of these, with the status found and right
    walls_shown: int  # by the echo
    walls_found: int  # of these
    walls_right: int  # mirrors on true walls, visible in the echo or not
    false_mirrors: int  # with confidence above 0.99
    doubtful_mirrors: int  # false ones with less
    false_targets: int
    targets_on_walls: int
    targets: int
    region: Coverage | None  # of the 95 % regions of positions found
    wall_region: Coverage | None  # of those of the walls, in 2-D
    stated: tuple[Stated, ...]
    wrong: tuple[str, ...]  # rooms answered wrongly
    worst_error: float  # of positions found [m]
    seconds: float  # median of the estimates' durations


def summarise(scores: Sequence[RoomScore]) -> RoomSummary:
    """Summarise scores.

    Raises
    ------
    ValueError
        If there is none.
    """
    if not scores:
        raise ValueError("no rooms to sum up; give one score at least")
    verdicts: dict[Verdict, int] = {
        "right": 0,
        "wrong": 0,
        "open, truth among them": 0,
        "open, truth not among them": 0,
        "none": 0,
    }
    for one in scores:
        verdicts[one.verdict] += 1
    found = [one for one in scores if one.status == "found"]
    squares = [one.square for one in found if one.square is not None]
    flat = all(one.wall_squares or not one.found for one in scores)
    walls = [square for one in scores for square in one.wall_squares]
    return RoomSummary(
        rooms=len(scores),
        verdicts=verdicts,
        answerable=sum(one.answerable for one in scores),
        answered=sum(one.answerable and one.verdict == "right" for one in scores),
        walls_shown=sum(len(one.shown) for one in scores),
        walls_found=sum(len(set(one.shown) & set(one.found)) for one in scores),
        walls_right=sum(len(one.found) for one in scores),
        false_mirrors=sum(one.false_mirrors for one in scores),
        doubtful_mirrors=sum(one.doubtful_mirrors for one in scores),
        false_targets=sum(one.false_targets for one in scores),
        targets_on_walls=sum(one.targets_on_walls for one in scores),
        targets=sum(one.targets for one in scores),
        region=coverage(squares, probability=0.95, axes=2 if flat else 3) if squares else None,
        wall_region=coverage(walls, probability=0.95, axes=2) if walls else None,
        stated=_reliability(scores),
        wrong=tuple(one.room for one in scores if one.verdict == "wrong"),
        worst_error=max((one.error for one in found if one.error is not None), default=0.0),
        seconds=float(np.median([one.seconds for one in scores])),
    )


def _reliability(scores: Sequence[RoomScore]) -> tuple[Stated, ...]:
    said: Float[np.ndarray, "places 2"] = np.array(
        [pair for one in scores for pair in one.stated], dtype=np.float64
    ).reshape(-1, 2)
    places = np.clip(np.digitize(said[:, 0], BINS) - 1, 0, len(BINS) - 2)
    return tuple(
        Stated(
            low=BINS[index],
            high=BINS[index + 1],
            places=int(np.sum(places == index)),
            mean=float(said[places == index, 0].mean()),
            right=int(said[places == index, 1].sum()),
        )
        for index in range(len(BINS) - 1)
        if np.any(places == index)
    )


def table_rows(summary: RoomSummary) -> tuple[tuple[str, str], ...]:
    """Return the lines of a summary: description and value."""
    counts = summary.verdicts
    rows = [
        ("rooms", f"{summary.rooms}"),
        ("found and right", f"{counts['right']}"),
        ("found and wrong", f"{counts['wrong']}"),
        ("ambiguous, the truth among the places", f"{counts['open, truth among them']}"),
        ("ambiguous, the truth not among them", f"{counts['open, truth not among them']}"),
        ("not found", f"{counts['none']}"),
        (
            "found and right, of the rooms that the oracle answers",
            f"{summary.answered} of {summary.answerable}",
        ),
        (
            "walls found, of those that the echo shows",
            f"{summary.walls_found} of {summary.walls_shown}",
        ),
        ("true walls found, shown or not", f"{summary.walls_right}"),
        (f"false mirrors, confidence above {CONFIDENT:g}", f"{summary.false_mirrors}"),
        ("false mirrors, less confident", f"{summary.doubtful_mirrors}"),
        ("targets where nothing is", f"{summary.false_targets} of {summary.targets}"),
        ("targets that lie on a wall", f"{summary.targets_on_walls} of {summary.targets}"),
        ("largest error of what was found", f"{1e3 * summary.worst_error:.3g} mm"),
    ]
    for what, held in (("places", summary.region), ("walls", summary.wall_region)):
        if held is not None:
            share = f"{100 * held.share:.0f} % ({100 * held.low:.0f}–{100 * held.high:.0f})"
            rows.append((f"{what} within their 95 % regions, of {held.trials}", share))
    rows += [
        (
            f"right, of the places stated with {one.low:g} to {one.high:g} (mean {one.mean:.3g})",
            f"{one.right} of {one.places}",
        )
        for one in summary.stated
    ]
    return (*rows, ("median duration of an estimate", f"{summary.seconds:.2g} s"))
