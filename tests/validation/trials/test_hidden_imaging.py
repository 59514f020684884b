"""Figures 2.10 and 2.11: what is seen only over a wall."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from matplotlib.figure import Figure

from scenes.files.loading import load_scenario
from validation.experiments import fig02_10_nlos_posts, fig02_11_nlos_box
from validation.trials.hidden_imaging import HiddenImaging, draw_hidden, hidden_rows, measure_hidden

QUARTER_SIZE = (
    "base_station.elements=61",
    "radio.points=251",
    "objects.wall.centre_m=[0.0, 0.15]",
    "objects.wall.length_m=0.075",
    "objects.screen.centre_m=[0.035, 0.0625]",
    "objects.screen.length_m=0.075",
    "objects.near_post.centre_m=[0.075, 0.14]",
    "objects.near_post.radius_m=0.002",
    "objects.far_post.centre_m=[0.10, 0.16]",
    "objects.far_post.radius_m=0.002",
)


@pytest.fixture(scope="module")
def posts() -> HiddenImaging:
    return measure_hidden(load_scenario("nlos_posts", QUARTER_SIZE), seed=0, wall="wall")


def failed(result: HiddenImaging) -> list[str]:
    return [row.name.split(",")[0] for row in hidden_rows([result]) if not row.passed]


def test_ghosts_unfold_onto_the_posts_front_faces(posts: HiddenImaging) -> None:
    assert failed(posts) == []
    assert [target.name for target in posts.targets] == ["far_post", "near_post"]


def test_a_post_missed_and_a_false_one_are_told(posts: HiddenImaging) -> None:
    wrong = replace(
        posts,
        targets=posts.targets[:1],
        missed=("near_post",),
        false_levels_db=(-9.0, -11.0),
    )
    assert wrong.false == 1
    assert failed(wrong) == [
        "objects missed", "false targets above -10 dB of the weakest true one",
    ]  # fmt: skip


def test_a_post_beside_its_place_is_told(posts: HiddenImaging) -> None:
    first, second = posts.targets
    near = replace(first, range_error=-2e-3, across_error=1.1 * first.cell_across)
    assert failed(replace(posts, targets=(near, second))) == [
        "unfolded front faces along range", "unfolded front faces across",
    ]  # fmt: skip


def test_nothing_found_fails_instead_of_passing_for_want_of_errors(posts: HiddenImaging) -> None:
    nothing = replace(posts, targets=(), missed=("far_post", "near_post"))
    assert "unfolded front faces along range" in failed(nothing)


def test_raw_and_unfolded_image_are_drawn_in_metres(posts: HiddenImaging) -> None:
    figure = Figure()
    draw_hidden(figure, posts)
    left, right = figure.axes[:2]
    for ax in (left, right):
        assert ax.get_aspect() == 1.0
        assert ax.get_xlabel() == "x, along the array [m]"
    assert left.get_xlim() == right.get_xlim()


@pytest.mark.slow
@pytest.mark.parametrize("measure", [fig02_10_nlos_posts.measure, fig02_11_nlos_box.measure])
@pytest.mark.parametrize("seed", [0, 1])
def test_half_of_all_lengths_keeps_the_claims(
    measure: Callable[..., HiddenImaging], seed: int
) -> None:
    assert failed(measure(seed=seed, quick=True)) == []
