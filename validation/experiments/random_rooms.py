"""Performance of the estimator in rooms drawn at random.

Run as ``python -m validation.experiments.random_rooms [--set plain] [--rooms 40] [--first 0]
[--tuning] [--workers 1] [--keep DIR] [--out FILE.json] [--write NUMBER FILE.toml]``.

Not in the thesis, which has a single room. :mod:`validation.random_rooms.prior` defines the prior,
:mod:`validation.random_rooms.oracle` which rooms can be answered. Rooms for judging are never used
for tuning; ``--tuning`` selects a separate set. The output has a line for each room and a table.
``--keep`` stores the simulated measurements, so that other versions of the estimator are judged by
the same ones; ``--out`` stores the scores; ``--write`` writes one room as a scenario file and ends.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from scenes.files.loading import scenario_to_toml
from validation.random_rooms.judging import judge_rooms, write_scores
from validation.random_rooms.prior import SETS, Purpose, draw_room
from validation.random_rooms.room_score import RoomScore
from validation.random_rooms.room_summary import summarise, table_rows


def score_line(score: RoomScore) -> str:
    """Return the line of one room."""
    error = "" if score.error is None else f" {1e3 * score.error:.3g} mm"
    square = "" if score.square is None else f", e'C⁻¹e {score.square:.3g}"
    walls = f"walls {len(set(score.shown) & set(score.found))}/{len(score.shown)} shown"
    false = f", {score.false_mirrors} FALSE" if score.false_mirrors else ""
    oracle = "answerable" if score.answerable else score.why
    stated = f", p {score.stated[0][0]:.4f}" if score.stated else ""
    reason = "" if score.reason is None else f" | {score.reason}"
    return (
        f"{score.room:24s} | {score.verdict}{error}{square}{stated} ({score.method}, "
        f"{score.bounces} bounces) | {walls}{false} | {oracle}{reason}"
    )


def main(arguments: Sequence[str]) -> int:
    """Print a line for each room and a table; return 1 if an answer or a mirror is wrong."""
    parser = argparse.ArgumentParser(description="Judge the estimator by random rooms.")
    parser.add_argument("--set", choices=list(SETS), default="plain")
    parser.add_argument("--rooms", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--write", nargs=2, metavar=("NUMBER", "FILE"))
    asked = parser.parse_args(arguments)
    purpose: Purpose = "tuning" if asked.tuning else "judging"
    if asked.write is not None:
        number, file = asked.write
        room = draw_room(asked.set, int(number), purpose=purpose)
        Path(file).write_text(scenario_to_toml(room), encoding="utf-8")
        return 0
    numbers = range(asked.first, asked.first + asked.rooms)
    scores = judge_rooms(
        asked.set,
        numbers,
        purpose=purpose,
        workers=asked.workers,
        keep=asked.keep,
        tell=lambda done, count: print(f"{done} of {count}", file=sys.stderr, flush=True),
    )
    for score in scores:
        print(score_line(score))
    if asked.out is not None:
        write_scores(asked.out, scores)
    summary = summarise(scores)
    for what, value in table_rows(summary):
        print(f"{what:72s} {value}")
    return 1 if summary.verdicts["wrong"] or summary.false_mirrors else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
