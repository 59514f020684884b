from pathlib import Path

import numpy as np
import pytest

from scenes.sampling.distributions import Choice, InPolygon, LogUniform, Normal
from scenes.sampling.sample_space import SampleSpace, open_sample_space
from scenes.sampling.variations import Variations, load_variations
from scenes.schema.errors import ScenarioError

SMALL = """
base = "point_scatterers"
seed = 5
set.base_station.elements = 4
set.radio.points = 4
"""

ROOM = """
base = "los_user"
count = 20
set.base_station.elements = 4
set.radio.points = 4
set."objects.wall.roughness" = { rms_mm = 0.05, correlation_mm = 3.0 }
"""


def read(tmp_path: Path, text: str) -> Variations:
    path = tmp_path / "config.toml"
    path.write_text(text, encoding="utf-8")
    return load_variations(path, Variations)


def space(tmp_path: Path, text: str) -> SampleSpace:
    return open_sample_space(read(tmp_path, text), tmp_path)


def refusal(tmp_path: Path, text: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        space(tmp_path, text).check()
    return str(caught.value)


VARIED = (
    SMALL
    + """
count = 30
[vary]
"points.near.position_m" = { kind = "in_box", low_m = [-0.1, 0.4], high_m = [0.1, 0.5] }
"noise.snr_db" = { kind = "uniform", low = 10.0, high = 30.0 }
"""
)


def test_a_sample_depends_on_seed_and_number_alone(tmp_path: Path) -> None:
    one, other = space(tmp_path, VARIED), space(tmp_path, VARIED)
    backwards = [other.first(n)[0].values for n in (7, 3, 0)]
    assert backwards == [one.first(n)[0].values for n in (7, 3, 0)]
    moved = space(tmp_path, VARIED.replace("seed = 5", "seed = 6"))
    assert moved.first(3)[0].values != one.first(3)[0].values


def test_varying_one_more_key_redraws_no_other(tmp_path: Path) -> None:
    more = VARIED + '"points.left.rcs_m2" = { kind = "log_uniform", low = 1e-5, high = 1e-3 }\n'
    for n in range(5):
        drawn = space(tmp_path, VARIED).first(n)[0].values
        again = space(tmp_path, more).first(n)[0].values
        assert {key: again[key] for key in drawn} == drawn


def test_what_was_drawn_is_what_the_scenario_holds(tmp_path: Path) -> None:
    attempt, _ = space(tmp_path, VARIED).first(4)
    assert attempt.scenario is not None
    assert attempt.scenario.noise.snr_db == attempt.values["noise.snr_db"]
    drawn = attempt.values["points.near.position_m"]
    assert list(attempt.scenario.points["near"].position_m) == drawn
    assert attempt.scenario.base_station.elements == 4


def test_a_grid_goes_through_every_combination_the_last_key_fastest(tmp_path: Path) -> None:
    grid = (
        SMALL
        + """
[vary]
"noise.snr_db" = { kind = "grid", values = [10.0, 20.0] }
"radio.points" = { kind = "grid", values = [4, 8, 16] }
"""
    )
    found = space(tmp_path, grid)
    assert found.variations.samples == 6
    steps = [tuple(found.first(n)[0].values.values()) for n in range(6)]
    assert steps == [(a, b) for a in (10.0, 20.0) for b in (4, 8, 16)]
    assert found.most() == (4, 16)


def test_lists_go_side_by_side(tmp_path: Path) -> None:
    listed = (
        SMALL
        + """
[vary.radio]
start_ghz = { kind = "list", values = [220.0, 230.0] }
stop_ghz = { kind = "list", values = [240.0, 260.0] }
"""
    )
    found = space(tmp_path, listed)
    radios = [found.first(n)[0].scenario.radio for n in range(found.variations.samples)]  # type: ignore[union-attr]
    assert [(radio.start_ghz, radio.stop_ghz) for radio in radios] == [(220, 240), (230, 260)]


def test_impossible_draws_are_drawn_again_and_counted(tmp_path: Path) -> None:
    close = VARIED.replace(
        "low_m = [-0.1, 0.4], high_m = [0.1, 0.5]", "low_m = [0.0, 0.0], high_m = [0.0, 0.003]"
    )
    redraws = []
    for n in range(30):
        attempt, count = space(tmp_path, close).first(n)
        assert attempt.scenario is not None
        # The longest wavelength, 1.36 mm, is how close a point may come.
        assert attempt.scenario.points["near"].position_m[1] > 1.3e-3
        redraws.append(count)
    # 45 % of the box is too close: 0.83 redraws on average; 30 draws scatter by 0.22.
    assert 0.2 < np.mean(redraws) < 1.5


def test_a_sample_that_is_never_possible_is_refused_with_the_reason(tmp_path: Path) -> None:
    never = VARIED.replace("high_m = [0.1, 0.5]", "high_m = [0.1, 0.0]").replace(
        "[-0.1, 0.4]", "[-0.1, 0.0]"
    )
    never = never.replace("[-0.1, 0.0], high_m = [0.1, 0.0]", "[0.0, 0.0], high_m = [0.0, 0.0]")
    assert "sample 0: none of 100 draws is possible; the last one: points.near" in refusal(
        tmp_path, never
    )


def test_copies_of_a_template_are_drawn_each_for_itself(tmp_path: Path) -> None:
    posts = (
        ROOM
        + """
[set.objects.post]
kind = "cylinder"
material = "metal"
centre_m = [0.5, 0.5]
radius_m = 0.01
[number.posts]
of = "objects.post"
least = 1
most = 3
vary.centre_m = { kind = "in_box", low_m = [0.4, 0.1], high_m = [0.8, 0.5] }
"""
    )
    found = space(tmp_path, posts)
    found.check()
    counts = set()
    for n in range(12):
        attempt, _ = found.first(n)
        assert attempt.scenario is not None
        names = [name for name in attempt.scenario.objects if name.startswith("post")]
        assert names == [f"post_{i + 1}" for i in range(int(attempt.values["number.posts"]))]  # type: ignore[call-overload]
        places = {attempt.scenario.objects[name].centre_m for name in names}
        assert len(places) == len(names)
        counts.add(len(names))
    assert counts == {1, 2, 3}
    assert found.names("objects") == ("wall", "post_1", "post_2", "post_3")
    assert found.kinds()["post_2"] == {"cylinder"}


def test_some_among_several_objects_exist(tmp_path: Path) -> None:
    some = (
        ROOM
        + """
[set.objects.post]
kind = "cylinder"
material = "metal"
centre_m = [0.5, 0.5]
radius_m = 0.01
[number.bodies]
among = ["objects.post", "objects.wall"]
least = 1
"""
    )
    found = space(tmp_path, some)
    kept = {tuple(found.first(n)[0].scenario.objects) for n in range(20)}  # type: ignore[union-attr]
    assert kept == {("wall",), ("post",), ("wall", "post")}
    assert found.names("objects") == ("wall", "post")


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (
            '"noise.snr" = { kind = "uniform", low = 1.0, high = 2.0 }',
            r"vary.noise.snr: unknown key (did you mean 'snr_db'?)",
        ),
        (
            '"noise.snr_db" = { kind = "uniform", low = -99.0, high = 2.0 }',
            "vary.noise.snr_db = -99.0: must be greater than or equal to -60",
        ),
        (
            '"objects.wal.angle_deg" = { kind = "uniform", low = 1.0, high = 2.0 }',
            "vary.objects.wal: no such name",
        ),
        (
            '"noise.snr_db" = { kind = "unifrom", low = 1.0, high = 2.0 }',
            "unknown kind (did you mean 'uniform'?)",
        ),
        (
            '"noise.snr_db" = { kind = "uniform", low = 3.0, high = 2.0 }',
            "low = 3.0 must not exceed high = 2.0",
        ),
        ('"radio.points" = { kind = "uniform", low = 4.0, high = 8.0 }', "vary.radio.points = 4"),
        (
            '"noise.snr_db" = { kind = "normal", mean = 0.0, deviation = 1.0, low = 6.0 }',
            "keep less than 1 %",
        ),
        (
            '"points.near.position_m" = { kind = "in_polygon", corners_m = [[0,0], [1,1], [2,2]] }',
            "corners",
        ),
        (
            '"noise.snr_db" = { kind = "choice", values = [1.0], weights = [1.0, 2.0] }',
            "2 weights for 1 values",
        ),
    ],
)
def test_wrong_variations_are_refused_before_any_work(tmp_path: Path, line: str, told: str) -> None:
    message = refusal(tmp_path, f"{SMALL}\ncount = 3\n[vary]\n{line}\n")
    assert told in message


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (SMALL, "count: missing"),
        (SMALL + "cuont = 3", "cuont: unknown key (did you mean 'count'?)"),
        (
            SMALL + 'count = 1\n[vary]\n"radio.points" = { kind = "grid", values = [4, 8] }',
            "count = 1: the grid has 2 combinations",
        ),
        ('base = "slam_3d"\ncount = 1', "did you mean 'slam_2d'?"),
        (
            SMALL + 'count = 1\n[number.it]\nof = "objects.post"\nmost = 2',
            "number.it.of = 'objects.post': no such table",
        ),
        (SMALL + "count = 1\n[number.it]\nmost = 2", "needs either of or among"),
        ("base = 3", "base = 3: must be a valid string"),
        ("base = ", "not valid TOML"),
        (
            SMALL + 'count = 1\nset."radio.poinst" = 4',
            "set.radio.poinst: unknown key (did you mean 'points'?)",
        ),
    ],
)
def test_wrong_configurations_say_key_and_remedy(tmp_path: Path, text: str, told: str) -> None:
    assert told in refusal(tmp_path, text)


def test_lists_of_different_lengths_are_refused(tmp_path: Path) -> None:
    text = (
        SMALL
        + """
[vary.radio]
points = { kind = "list", values = [4, 8] }
start_ghz = { kind = "list", values = [220.0] }
"""
    )
    assert "have different lengths" in refusal(tmp_path, text)


def test_log_uniform_draws_every_octave_alike() -> None:
    rng = np.random.default_rng(0)
    drawn = [LogUniform(kind="log_uniform", low=1.0, high=8.0).draw(rng) for _ in range(3000)]
    share = np.histogram(np.log2(drawn), bins=[0, 1, 2, 3])[0] / 3000
    assert share == pytest.approx(1 / 3, abs=4 * np.sqrt(2 / 9 / 3000))  # four deviations


def test_a_cut_off_normal_keeps_within_its_ends() -> None:
    rng = np.random.default_rng(0)
    normal = Normal(kind="normal", mean=0.0, deviation=1.0, low=0.0, high=1.0)
    drawn = [normal.draw(rng) for _ in range(2000)]
    assert 0 <= min(drawn)
    assert max(drawn) <= 1
    # Mean of the half normal cut at 1: (φ(0) − φ(1)) / (Φ(1) − Φ(0)) = 0.4598.
    assert np.mean(drawn) == pytest.approx(0.4598, abs=4 * 0.284 / np.sqrt(2000))


def test_weights_say_how_often_a_value_is_chosen() -> None:
    rng = np.random.default_rng(0)
    choice = Choice(kind="choice", values=("a", "b", "c"), weights=(1.0, 0.0, 3.0))
    drawn = [choice.draw(rng) for _ in range(2000)]
    assert "b" not in drawn
    assert drawn.count("c") / 2000 == pytest.approx(0.75, abs=4 * np.sqrt(0.1875 / 2000))


def test_places_in_a_polygon_fill_it_evenly() -> None:
    rng = np.random.default_rng(0)
    plan = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0))
    corners = tuple((x, y, 0.0) for x, y in plan)
    region = InPolygon(kind="in_polygon", corners_m=corners, low_z_m=1.0, high_z_m=2.0)
    places = np.array([region.draw(rng) for _ in range(3000)])
    x, y, z = places.T
    assert not np.any((x > 1) & (y > 1))  # the corner that the L leaves out
    assert z.min() >= 1
    assert z.max() <= 2
    share = np.mean((x < 1) & (y < 1))  # one of three equal squares
    assert share == pytest.approx(1 / 3, abs=4 * np.sqrt(2 / 9 / 3000))
