"""Measurements of the estimator's thresholds on draws of noise, speckle, rough walls and rooms.

Run as ``python -m validation.experiments.thresholds [TABLE ...] [DRAWS] [--only CONSTANT ...]``;
with ``--only BLOCKED --only USUAL`` the tables of scans hold these constants alone.

Not in the thesis, whose walls are marked by hand. Ten tables:

- ``chance``: false-alarm rates and false detections by noise and random peaks
  (:mod:`validation.trials.chance_finds`);
- ``walls``: the statistics of true walls that thresholds bound, in closed form and simulated
  (:mod:`validation.trials.wall_statistics`);
- ``scans``: walls found, false walls, and the error of the walls' angle, as one constant at a time
  is changed to neighbouring values. If neighbours give the same result, the constant needs no
  finer choice; if one loses walls or adds false ones, this justifies the constant;
- ``answers``: the same for users, walls and targets of whole estimates in simulated rooms
  (:mod:`validation.trials.room_answers`), with :data:`ROOM_SEEDS` realisations of each;
- ``decisions``: the same for constants that decide on users alone, each room mapped once;
- ``images``: targets at scatterers and false ones in scans in closed form, of points, letters and
  soil, with a linear and a planar array (:mod:`validation.trials.measured_scans`);
- ``space``: as ``answers`` in rooms in space (the set ``space`` of random rooms, those for tuning);
- ``lists``: the same for priors of path lists (:mod:`validation.trials.list_answers`);
- ``limits``: what is lost by limits of searches (:mod:`validation.trials.numerical_limits`);
- ``rooms``: walls of random rooms, one for each draw (:mod:`validation.trials.lines_in_rooms`).

Claims that are asserted: each threshold does what its docstring states, within the limits in the
table; and no scan's own value gives fewer right answers, or more false ones, than a neighbour.
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.stats import binom

from estimator.localization.pipeline import locate
from estimator.walls import fitted_line, line_refinement, line_relations, wall_detection_2d
from simulator.simulation import simulate
from validation.experiments.measured_scans import false_targets as targets_away
from validation.harness.claim import Row
from validation.harness.row_table import conclude
from validation.metrics.truth import truth_from_dataset
from validation.random_rooms.prior import SEEDS, draw_room
from validation.trials.answer_scans import label, only_named, scanned_rows
from validation.trials.chance_finds import chance_rows
from validation.trials.constant_scans import (
    ANSWER_SCANS,
    DECISION_SCANS,
    DECISIONS,
    IMAGE_SCANS,
    LIST_SCANS,
    RIVAL_SCAN,
    SPACE_SCANS,
    Scan,
)
from validation.trials.drawn_echoes import Kind
from validation.trials.lines_in_rooms import room_line_rows
from validation.trials.list_answers import (
    drawn_lists,
    list_answers,
    listed_orders,
    unlisted_alone,
)
from validation.trials.measured_scans import KINDS, DrawnScan, drawn_scan
from validation.trials.numerical_limits import limit_rows
from validation.trials.path_lists import KINDS as ROOM_KINDS
from validation.trials.room_answers import (
    DIFFUSE,
    DIFFUSE_SEEDS,
    Answers,
    SimulatedRoom,
    answers,
    diffuse_answers,
    each_mapped_once,
    rough_pilot,
    simulated_room,
)
from validation.trials.wall_statistics import (
    WALLS,
    Detection,
    Surveyed,
    WallStatistics,
    changed,
    crossing_overlap,
    detection,
    followed_overlap,
    simulated_wall,
    surveyed,
    wall_statistics,
)

TABLES = tuple("chance walls scans answers decisions images space lists limits rooms".split())
DRAWS = 12
"""Walls of each family. [-]"""
ROOM_SEEDS = 1
"""Realisations of each room: every one is located with all values of a constant. [-]"""
SCAN_SEEDS = 3
"""Scans of each kind and array: of seeds below 1000, which are for tuning. [-]"""
SPACE_ROOMS = 2
"""Rooms in space. [-]"""
BRIGHT_ASIDE = ("plain", 4)
"""Random room for tuning with the most bright sources beyond the imaged sector, of the first five
of its set."""
HELD_ROOMS = 50
"""Rooms of each kind whose lists are counted, in the plane and in space. [-]"""
LIST_ROOMS = 2
"""Rooms of each kind with path lists, in the plane and in space. [-]"""
SCENES: tuple[Kind, ...] = ("wall", "wall", "wall", "corner", "corner", "corner", "posts", "noise")
"""Echoes on which constants are scanned, besides one simulated wall of each family. [-]"""

COUNTED = 0.99
"""Probability with which a count of walls is no more than its limit, if the share is as stated.
[-]"""
USUAL_SHARES = 2.1, 1.3
"""Largest mean squares of tilt and offset over the modes' expectation, as stated in the docstring
of :data:`estimator.walls.line_fit_image.TILT_SHARE`. [-]"""
LARGER_SHARES = {
    "metal, 40 cm, 45°, 0.05 mm": (15.5, 5.1),
    "metal, 20 cm, 45°, 0.1 mm": (4.2, 3.8),
}
"""The same of the families for which that docstring states larger ones: a known fault of lines that
the echo does not place, which must not grow. [-]"""


SCANS = (
    Scan(module="estimator.imaging.survey_2d", name="MOST_GAIN", values=(1.1, 1.5)),
    Scan(module="estimator.imaging.peak_detection", name="DYNAMIC_RANGE", values=(1e-5, 1e-4)),
    Scan(module="estimator.walls.line_detection", name="FEWEST_INLIERS", values=(4.0, 7.0)),
    Scan(module="estimator.walls.line_detection", name="TOLERANCE", values=(0.35, 0.75)),
    Scan(module="estimator.walls.line_detection", name="LEAST_APART", values=(2.0, 5.0)),
    Scan(module="estimator.walls.line_detection", name="GAP", values=(4.0, 10.0)),
    Scan(module="estimator.walls.line_sampling", name="CELLS_CUT", values=(1.0, 3.0)),
    Scan(module="estimator.walls.line_extent", name="LEAST_LIT", values=(0.1, 0.5)),
    Scan(module="estimator.walls.line_extent", name="END_LEVEL", values=(0.03, 0.2)),
    Scan(module="estimator.walls.line_fit_image", name="SUMMIT", values=(0.4, 0.8)),
    Scan(module="estimator.walls.line_fit_image", name="LEAST_RISE", values=(0.9, 1.0)),
    Scan(module="estimator.walls.scatterer_row", name="OVERSAMPLING", values=(1.0, 1.5)),
    Scan(module="estimator.walls.line_refinement", name="CUT_SHARE", values=(0.1, 0.6)),
    Scan(module="estimator.walls.line_relations", name="BESIDE", values=(1.5, 3.0)),
    Scan(module="estimator.walls.line_relations", name="BEYOND_END", values=(2.0, 8.0)),
    Scan(module="estimator.walls.line_relations", name="GOOD_PART", values=(0.2, 0.6)),
    Scan(module="estimator.walls.fitted_line", name="MOST_UNCERTAIN", values=(0.25, 1.0)),
    Scan(module="estimator.walls.wall_detection_2d", name="LEAST_CONTRAST", values=(5.0, 20.0)),
    Scan(module="estimator.walls.wall_detection_2d", name="LEAST_CELLS", values=(6.0, 12.0)),
    Scan(module="estimator.walls.wall_detection_2d", name="NEAREST", values=(0.25, 1.0)),
)
EVERY_SCAN: tuple[Sequence[Scan], ...] = (
    SCANS, ANSWER_SCANS, (RIVAL_SCAN,), DECISION_SCANS, IMAGE_SCANS, SPACE_SCANS, LIST_SCANS,
)  # fmt: skip
"""All scans, by table."""


def wall_rows(name: str, walls: list[WallStatistics]) -> list[Row]:
    """Compare the statistics of the walls of one family with the thresholds that bound them.

    Parameters
    ----------
    name
        Of the family.
    walls
        Its draws.
    """

    def column(key: str) -> np.ndarray:
        values = np.array([getattr(one, key) for one in walls], dtype=np.float64)
        return np.asarray(values[np.isfinite(values)])

    def row(
        constant: str,
        stated: str,
        measured: float,
        *,
        low: float | None = None,
        high: float | None = None,
    ) -> Row:
        return Row(
            name=f"{constant} ({name})",
            stated=stated,
            measured=measured,
            low=low,
            high=high,
            origin="the constant",
        )

    most = LARGER_SHARES.get(name, USUAL_SHARES)
    found = column("turn").size / len(walls)
    if found == 0:
        return [row("walls found", "all but one in ten", 0.0, low=0.9)]
    return [
        row("walls found", "all but one in ten", found, low=0.9),
        row("line_relations.BESIDE: 99 % of a wall's peaks, median", "cells",
            float(np.median(column("beside"))), high=line_relations.BESIDE),
        row("line_relations.BEYOND_END: walls with a peak beyond", "one wall in ten, as counted",
            float(np.sum(column("beyond_end") > line_relations.BEYOND_END)),
            high=float(binom.ppf(COUNTED, len(walls), 0.1))),
        row("wall_detection_2d.MOST_BENT: bent peaks, the worst", "share",
            float(column("bent").max()), high=wall_detection_2d.MOST_BENT),
        row("wall_detection_2d.WALL_COHERENCE: median over a wall, the worst", "coherence",
            float(column("coherence").min()), low=wall_detection_2d.WALL_COHERENCE),
        row("wall_detection_2d.LEAST_CONTRAST: the least", "level over background",
            float(column("contrast").min()), low=wall_detection_2d.LEAST_CONTRAST),
        row("fitted_line.MOST_UNCERTAIN: deviation, the worst", "cells",
            float(column("deviation").max()), high=fitted_line.MOST_UNCERTAIN),
        row("line_refinement.EXPLAINED: by the row, the least", "share",
            float(column("explained").min()), low=line_refinement.EXPLAINED),
        row("line_refinement.DISAGREEMENT: of image and echo, median", "over covariances",
            float(np.median(column("disagreement"))), high=line_refinement.DISAGREEMENT),
        row("line_fit_image.TILT_SHARE: mean square over what modes let expect", f"≤ {most[0]}",
            float(column("tilt_share").mean()), high=most[0] * (1 + 4 / np.sqrt(len(walls)))),
        row("line_fit_image.OFFSET_SHARE: the same of the offset", f"≤ {most[1]}",
            float(column("offset_share").mean()), high=most[1] * (1 + 4 / np.sqrt(len(walls)))),
    ]  # fmt: skip


def overlap_rows(echoes: tuple[Surveyed, ...], *, draws: int = 400) -> list[Row]:
    """Compare the overlaps of crossing walls and of two fits of one wall with the threshold."""
    crossing = crossing_overlap(np.random.default_rng(0), draws=draws)
    one_wall = [followed_overlap(one) for one in echoes if one.drawn.kind == "wall"]
    return [
        Row(
            name="line_relations.GOOD_PART: share of a wall on one that crosses it, the largest",
            stated="walls that cross share the cells of the crossing",
            measured=float(crossing.max()),
            high=line_relations.GOOD_PART,
            origin="the constant",
        ),
        Row(
            name="line_relations.GOOD_PART: share of a wall on another fit of it, the least",
            stated="both are followed to the wall's ends",
            measured=float(np.nanmin(one_wall)),
            low=line_relations.GOOD_PART,
            origin="the constant",
        ),
    ]


def random_room(kind: str, number: int) -> SimulatedRoom:
    """Simulate a random room for tuning, with its truth."""
    room = draw_room(kind, number, purpose="tuning")
    simulation = simulate(room, seed=SEEDS["tuning"], sample=number)
    return SimulatedRoom(
        measurement=simulation.measurement, truth=truth_from_dataset(simulation.truth)
    )


def scan_answers(scans: Sequence[DrawnScan]) -> Answers:
    """Count the scans of which a target is at a scatterer as right, and false targets."""
    right = targets = false = 0
    for one in scans:
        estimate = locate(one.measurement, images=False)
        wrong = targets_away(one, estimate)
        right += len(estimate.targets) > wrong
        targets, false = targets + len(estimate.targets), false + wrong
    return Answers(
        right=right, wrong=0, median_error=np.nan, walls=0, false_walls=0, targets=targets,
        false_targets=false,
    )  # fmt: skip


def scan(one: Scan, echoes: tuple[Surveyed, ...]) -> dict[float, Detection]:
    """Detect the walls of echoes with a constant's own value and with the neighbouring ones."""
    own = getattr(sys.modules[one.module], one.name)
    results = {}
    for value in sorted({own, *one.values}):
        with changed(one.module, one.name, type(own)(value)):
            results[value] = detection(echoes)
    return results


def scan_line(one: Scan, results: dict[float, Detection]) -> str:
    """Return the line of a scan; the constant's own value is in brackets."""
    own = getattr(sys.modules[one.module], one.name)
    parts = []
    for value, result in results.items():
        label = f"[{value:g}]" if value == own else f"{value:g}"
        parts.append(
            f"{label}: {result.found}/{result.walls} walls, {result.false} false, "
            f"{np.degrees(result.median_turn):.4f}°"
        )
    return f"{one.module.removeprefix('estimator.')}.{one.name}: " + "; ".join(parts)


def scan_row(one: Scan, results: dict[float, Detection]) -> Row:
    """Return by how many walls the constant's own value is behind the best neighbour."""
    own = getattr(sys.modules[one.module], one.name)
    merit = {value: result.found - result.false for value, result in results.items()}
    return Row(
        name=f"{one.module.removeprefix('estimator.')}.{one.name}: true less false walls, behind",
        stated="none of its neighbours does better by more than one wall",
        measured=max(merit.values()) - merit[own],
        high=1.0,
        origin="one wall of the draws: the scatter of a count",
    )


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse the command line: ``tables``, ``draws`` and ``only``."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.experiments.thresholds", description=__doc__.partition("\n")[0]
    )
    parser.add_argument(
        "given", nargs="*", metavar="TABLE|DRAWS", help=f"tables: {', '.join(TABLES)}"
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="NAME",
        help="scan this constant only, e.g. BLOCKED; may be repeated",
    )  # fmt: skip
    options = parser.parse_args(arguments)
    options.tables = [one for one in options.given if not one.isdigit()] or list(TABLES)
    options.draws = next((int(one) for one in options.given if one.isdigit()), DRAWS)
    for one in options.tables:
        if one not in TABLES:
            parser.error(f"table {one!r} is none of {', '.join(TABLES)}")
    for name in options.only:
        if not any(only_named(scans, [name]) for scans in EVERY_SCAN):
            known = sorted({label(one) for scans in EVERY_SCAN for one in scans})
            parser.error(f"--only {name}: no constant that is scanned; choose {', '.join(known)}")
    return options


def main(arguments: list[str]) -> None:
    """Print the requested tables; fail if a threshold does not do what its docstring states."""
    options = parsed(arguments)
    wanted, draws = options.tables, options.draws
    rows: list[Row] = []
    if "chance" in wanted:
        rows += chance_rows(np.random.default_rng(0))
    if "walls" in wanted:
        closed = surveyed(["wall"] * draws, 0)
        rows += overlap_rows(closed)
        rows += wall_rows("closed form", [wall_statistics(one) for one in closed])
        for name, overrides in WALLS.items():
            rows += wall_rows(
                name,
                [wall_statistics(simulated_wall(overrides, seed)) for seed in range(draws)],
            )
            print(f"measured: {name}", file=sys.stderr, flush=True)
    if "scans" in wanted and (scans := only_named(SCANS, options.only)):
        echoes = surveyed(SCENES, 1)
        echoes += tuple(simulated_wall(overrides, 100) for overrides in WALLS.values())
        for one in scans:
            results = scan(one, echoes)
            print(scan_line(one, results), flush=True)
            rows.append(scan_row(one, results))
    if "answers" in wanted:
        rows += answers_rows(only_named(ANSWER_SCANS, options.only))
        if only_named([RIVAL_SCAN], options.only):
            pilots = [rough_pilot(*wall, seed) for wall in DIFFUSE for seed in range(DIFFUSE_SEEDS)]
            rows += scanned_rows([RIVAL_SCAN], partial(diffuse_answers, pilots))
    if "decisions" in wanted and (scans := only_named(DECISION_SCANS, options.only)):
        placed = [simulated_room(name, 0) for name in DECISIONS]
        with each_mapped_once():
            rows += scanned_rows(scans, partial(answers, placed))
    if "images" in wanted and (scans := only_named(IMAGE_SCANS, options.only)):
        scanned = [
            drawn_scan(kind, np.random.default_rng([seed, number, planar]), planar=bool(planar))
            for seed in range(SCAN_SEEDS)
            for number, kind in enumerate(KINDS)
            for planar in (0, 1)
        ]
        rows += scanned_rows(scans, partial(scan_answers, scanned))
    if "space" in wanted and (scans := only_named(SPACE_SCANS, options.only)):
        spaces = [random_room("space", number) for number in range(SPACE_ROOMS)]
        rows += scanned_rows(scans, partial(answers, spaces))
    if "lists" in wanted and (scans := only_named(LIST_SCANS, options.only)):
        walked = drawn_lists(LIST_ROOMS)
        for kind in ROOM_KINDS:
            held = [one for one in drawn_lists(HELD_ROOMS) if one.kind == kind]
            print(
                f"{kind}: listed paths over 0 to 3 walls {np.round(listed_orders(held), 2)}; "
                f"second walls of pairs that are not listed alone {unlisted_alone(held):.2f}"
            )
        rows += scanned_rows(scans, partial(list_answers, walked))
    if "limits" in wanted:
        echoes = surveyed(SCENES, 1)
        echoes += tuple(simulated_wall(overrides, 100) for overrides in WALLS.values())
        aside = random_room(*BRIGHT_ASIDE).measurement.echo
        assert aside is not None
        rows += limit_rows(echoes, aside, [rough_pilot(*wall, 0) for wall in DIFFUSE])
    if "rooms" in wanted:
        rows += room_line_rows([random_room("plain", number) for number in range(draws)])
    conclude(rows)


def answers_rows(scans: Sequence[Scan]) -> list[Row]:
    """Scan constants of whole answers, each on its own rooms, which are simulated once."""
    simulated: dict[tuple[str, int], SimulatedRoom] = {}
    rows = []
    for one in scans:
        keys = [(name, seed) for name in one.rooms for seed in range(ROOM_SEEDS)]
        for key in keys:
            if key not in simulated:
                simulated[key] = simulated_room(*key)
        rows += scanned_rows([one], partial(answers, [simulated[key] for key in keys]))
    return rows


if __name__ == "__main__":
    main(sys.argv[1:])
