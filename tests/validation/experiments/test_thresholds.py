"""The estimator's thresholds do what they say, on few draws; the full tables have many."""

import importlib
from dataclasses import replace

import numpy as np
import pytest

from estimator.walls import line_relations
from validation.experiments.thresholds import (
    EVERY_SCAN,
    SCANS,
    overlap_rows,
    parsed,
    scan,
    scan_row,
    wall_rows,
)
from validation.trials import chance_finds
from validation.trials.answer_scans import answer_line, answer_row, label, only_named
from validation.trials.constant_scans import ANSWER_SCANS, DECISION_SCANS, RIVAL_SCAN, Scan
from validation.trials.drawn_echoes import draw_echo
from validation.trials.list_answers import list_answers, listed_orders, unlisted_alone
from validation.trials.numerical_limits import (
    facets_of_a_cloud,
    ridges_of_echoes,
    rounds_of_trilateration,
    shoulders_of_walls,
)
from validation.trials.path_lists import SounderErrors, drawn_paths
from validation.trials.room_answers import answers, diffuse_answers, rough_pilot, simulated_room
from validation.trials.wall_statistics import changed, detection, surveyed, wall_statistics


def test_noise_passes_the_threshold_of_a_rate_as_often_as_the_rate_says() -> None:
    row = chance_finds.highest_of_cells(np.random.default_rng(0), trials=2000)
    assert row.passed, row.value


def test_strewn_peaks_make_no_lines_and_no_planes() -> None:
    rng = np.random.default_rng(1)
    assert chance_finds.strewn_lines(rng, peaks=100, images=2).passed
    assert chance_finds.strewn_planes(rng, volumes=3).passed


def test_speckle_has_no_gaps_as_wide_as_those_that_end_a_wall() -> None:
    for row in chance_finds.speckle_gap(np.random.default_rng(2), cells=20_000):
        assert row.passed, row.value


def test_speckle_and_smoothed_background_are_as_dark_and_as_bright_as_stated() -> None:
    rng = np.random.default_rng(3)
    rows = [*chance_finds.speckle_levels(rng), chance_finds.smoothed_background(rng, pixels=500)]
    for row in rows:
        assert row.passed, f"{row.name}: {row.value}"


def test_a_rough_wall_is_found_and_lies_within_what_thresholds_allow() -> None:
    echoes = surveyed(["wall"], 0)
    for row in wall_rows("one wall", [wall_statistics(one) for one in echoes]):
        assert row.passed, f"{row.name}: {row.value}"
    for row in overlap_rows(echoes, draws=50):
        assert row.passed, f"{row.name}: {row.value}"


def test_noise_shows_no_wall() -> None:
    result = detection(surveyed(["noise"], 0))
    assert (result.walls, result.false) == (0, 0)


def test_a_wall_whose_contrast_is_not_enough_is_not_found() -> None:
    """The scan of a constant changes what the detection does, and changes it back."""
    echoes = surveyed(["wall"], 0)
    with changed("estimator.walls.wall_detection_2d", "LEAST_CONTRAST", 1e9):
        assert detection(echoes).found == 0
    assert detection(echoes).found == 1


def test_a_constant_is_changed_wherever_it_is_imported() -> None:
    user = importlib.import_module("estimator.walls.line_refinement")
    own = line_relations.BEYOND_END
    with changed("estimator.walls.line_relations", "BEYOND_END", 2.5):
        assert vars(user)["BEYOND_END"] == 2.5
    assert vars(user)["BEYOND_END"] == own


@pytest.mark.parametrize(
    "one",
    [one for scans in EVERY_SCAN for one in scans],
    ids=label,
)
def test_each_scan_is_of_a_constant_that_exists_between_the_values_tried(one: Scan) -> None:
    low, high = one.values
    module = importlib.import_module(one.module)
    own = getattr(module, one.name)
    assert low < own < high


def test_a_table_of_scans_holds_the_constants_that_are_asked_for_alone() -> None:
    options = parsed(["decisions", "--only", "BLOCKED", "--only", "posterior.USUAL"])
    scans = only_named(DECISION_SCANS, options.only)
    assert [label(one) for one in scans] == ["posterior.USUAL", "level_likelihood.BLOCKED"]
    assert only_named(DECISION_SCANS, parsed(["3"]).only) == DECISION_SCANS


def test_a_constant_or_a_table_that_is_not_there_is_refused_with_those_that_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for arguments in (["--only", "BLOKED"], ["decsions"]):
        with pytest.raises(SystemExit):
            parsed(arguments)
    told = capsys.readouterr().err
    assert "--only BLOKED: no constant that is scanned; choose" in told
    assert "level_likelihood.BLOCKED" in told
    assert "table 'decsions' is none of chance, walls" in told


def test_path_lists_give_right_users_and_none_where_paths_agree_by_chance_for_sure() -> None:
    exact = SounderErrors(
        angle=np.radians(0.5), delay=0.05e-9, level_db=0.5, missed=0.0, scattered=0.0
    )
    whole = drawn_paths(np.random.default_rng(7001), "open", space=False, errors=exact)
    room = replace(
        whole,
        **{name: getattr(whole, name)[:6] for name in ("lists", "users", "direct", "chains")},
    )
    orders = listed_orders([room])
    assert orders[0] == len(room.lists) / sum(one.delay.size for one in room.lists)
    assert orders.sum() == pytest.approx(1)
    assert 0 <= unlisted_alone([room]) < 0.5
    seen = list_answers([room])
    assert (seen.right, seen.wrong, seen.false_walls) == (len(room.lists), 0, 0)
    (one,) = (scan for scans in EVERY_SCAN for scan in scans if scan.name == "BY_CHANCE")
    with changed(one.module, one.name, 1e300):
        lost = list_answers([room])
    assert lost.right == 0
    own = getattr(importlib.import_module(one.module), one.name)
    assert "differs in 1 of 1" in answer_line(one, {own: seen, 1e300: lost})


def test_a_user_in_sight_is_a_right_answer_and_is_lost_where_no_path_may_count() -> None:
    room = simulated_room("in sight beside it", 0)
    seen = answers([room])
    assert (seen.right, seen.wrong, seen.false_targets) == (1, 0, 0)
    (one,) = (one for one in ANSWER_SCANS if one.name == "LEAST_SHARE")
    with changed(one.module, one.name, 2.0):
        lost = answers([room])
    assert (lost.right, lost.walls) == (0, seen.walls)
    own = getattr(importlib.import_module(one.module), one.name)
    assert answer_row(one, {own: seen, 2.0: lost}).measured == 0
    assert not answer_row(one, {own: lost, 2.0: replace(seen, right=3)}).passed


def test_a_user_over_a_rough_wall_is_placed_unless_no_wall_may_count_as_lit() -> None:
    pilot = rough_pilot(60.0, 0.05, 0)
    placed = diffuse_answers([pilot])
    assert (placed.right, placed.wrong) == (1, 0)
    with changed(RIVAL_SCAN.module, "FEWEST_LIT", 1.1):
        open_ = diffuse_answers([pilot])
    assert (open_.right, open_.wrong) == (0, 0)


def test_limits_of_searches_leave_out_what_they_say() -> None:
    echoes = surveyed(["wall"], 0)
    rows = [*ridges_of_echoes(echoes), *shoulders_of_walls(echoes)]
    rows += [
        *rounds_of_trilateration([rough_pilot(60.0, 0.05, 0)]),
        *facets_of_a_cloud(np.random.default_rng(0), draws=5),
    ]
    for row in rows:
        assert row.passed, f"{row.name}: {row.value}"
    with changed("estimator.mapping.diffuse_multipath", "FACETS", 3):
        few, _ = facets_of_a_cloud(np.random.default_rng(0), draws=5)
    assert not few.passed
    with changed("estimator.walls.ridge_detection", "MOST_RIDGES", 1):
        (bound,) = ridges_of_echoes(echoes)
    assert not bound.passed


@pytest.mark.slow
def test_no_neighbouring_value_of_a_constant_finds_more_walls() -> None:
    echoes = surveyed(["wall", "corner", "posts", "noise"], 3)
    for one in SCANS:
        row = scan_row(one, scan(one, echoes))
        assert row.passed, f"{row.name}: {row.value}"


def test_corners_are_drawn_with_both_walls_in_sight() -> None:
    for seed in range(5):
        walls = draw_echo("corner", np.random.default_rng(seed)).walls
        spans = [sorted(end[0] / end[1] for end in wall) for wall in walls]
        assert min(spans[0][1], spans[1][1]) <= max(spans[0][0], spans[1][0]) + 1e-9
