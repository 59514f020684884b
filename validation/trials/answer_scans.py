"""Scans of one constant: answers with its own value and with neighbouring ones, as table rows.

A scan says nothing of a constant on which no answer depends. Each line therefore tells in how many
rooms an answer differs by anything at all from that with the constant's own value.
"""

import importlib
import sys
from collections.abc import Callable, Sequence

from validation.harness.claim import Row
from validation.trials.constant_scans import Scan
from validation.trials.room_answers import Answers
from validation.trials.wall_statistics import changed


def only_named(scans: Sequence[Scan], only: Sequence[str]) -> tuple[Scan, ...]:
    """Select the scans of some constants.

    Parameters
    ----------
    scans
        To select from.
    only
        Names, such as ``BLOCKED`` or ``level_likelihood.BLOCKED``; none: all scans.
    """
    return tuple(one for one in scans if not only or {one.name, label(one)} & set(only))


def label(one: Scan) -> str:
    """Return a constant's module and name, without the packages around them."""
    return f"{one.module.rpartition('.')[2]}.{one.name}"


def answer_scan(
    one: Scan, answered: Callable[[], Answers], known: Answers | None = None
) -> dict[object, Answers]:
    """Count answers with a constant's own value, unless known, and with the neighbouring ones."""
    own = getattr(importlib.import_module(one.module), one.name)
    results = {}
    for value in sorted({own, *one.values}):
        if known is not None and value == own:
            results[value] = known
            continue
        with changed(one.module, one.name, type(own)(value)):
            results[value] = answered()
    return results


def scanned_rows(scans: Sequence[Scan], answered: Callable[[], Answers]) -> list[Row]:
    """Scan constants on the same rooms: their own values are tried once for all."""
    if not scans:
        return []
    known = answered()
    rows = []
    for one in scans:
        told = answer_scan(one, answered, known)
        print(answer_line(one, told), flush=True)
        rows.append(answer_row(one, told))
    return rows


def answer_line(one: Scan, results: dict[object, Answers]) -> str:
    """Return the line of a scan of answers; the constant's own value is in brackets."""
    own = getattr(sys.modules[one.module], one.name)
    parts = []
    for value, result in results.items():
        number = f"{value:g}" if isinstance(value, float | int) else str(value)
        others = sum(a != b for a, b in zip(result.told, results[own].told, strict=True))
        parts.append(
            f"{f'[{number}]' if value == own else number}: "
            f"users {result.right} right, {result.wrong} wrong "
            f"({1e3 * result.median_error:.3f} mm), walls {result.walls}, "
            f"{result.false_walls} false, targets {result.targets}, {result.false_targets} false"
            + ("" if value == own else f", differs in {others} of {len(result.told)}")
        )
    return f"{one.module.removeprefix('estimator.')}.{one.name}: " + "; ".join(parts)


def answer_row(one: Scan, results: dict[object, Answers]) -> Row:
    """Return by how many answers the constant's own value is behind the best neighbour."""
    own = getattr(sys.modules[one.module], one.name)
    best = max(result.merit for result in results.values())
    module = one.module.removeprefix("estimator.")
    return Row(
        name=f"{module}.{one.name}: right less false answers, behind",
        stated="none of its neighbours is better by more than one answer",
        measured=float(best - results[own].merit),
        high=1.0,
        origin="one answer of the draws: the scatter of a count",
    )
