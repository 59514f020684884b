from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.geometry.wall_2d import Wall, mirrored
from estimator.measurement.model import Uplink
from estimator.positioning.diffuse_fallback import with_diffuse_search
from estimator.positioning.diffuse_positioning import search_diffuse
from estimator.positioning.wall_anchors import SeenWall, further_distances
from estimator.results.estimate import PathReport, UserEstimate
from estimator.walls.fitted_line import FittedLine

FREQUENCIES = np.linspace(220e9, 295e9, 301)  # unambiguous to 1.2 m
ELEMENTS = np.stack([0.5e-3 * (np.arange(200) - 99.5), np.zeros(200), np.zeros(200)], axis=-1)
WALL = Wall(
    start=np.array([-0.12, 0.38, 0.0]),
    end=np.array([0.12, 0.62, 0.0]),
    covariance=np.diag([1e-5, 1e-6]) ** 2,
)
USER = np.array([0.35, 0.45, 0.0])


def scattered_pilot(
    points: Float[np.ndarray, "points 3"],
    user: Float[np.ndarray, " 3"],
    seed: int,
    snr_db: float = 20.0,
) -> Uplink:
    """Sum point scatterers of random amplitude: over each to the array, in free space."""
    rng = np.random.default_rng(seed)
    amplitudes = rng.standard_normal((2, len(points)))
    samples = np.zeros((len(ELEMENTS), FREQUENCIES.size), dtype=np.complex128)
    for point, real, imaginary in zip(points, *amplitudes, strict=True):
        lengths = np.linalg.norm(ELEMENTS - point, axis=-1) + np.linalg.norm(user - point)
        turns = lengths[:, None] * FREQUENCIES / speed_of_light
        samples += (real + 1j * imaginary) * np.exp(-2j * np.pi * (turns - np.rint(turns)))
    level = np.sqrt(np.mean(np.abs(samples) ** 2) / 10 ** (snr_db / 10) / 2)
    noise = rng.standard_normal((2, *samples.shape))
    samples += level * (noise[0] + 1j * noise[1])
    return Uplink(samples=samples, positions=ELEMENTS, frequencies=FREQUENCIES, user="user")


def on(wall: Wall, count: int = 150) -> Float[np.ndarray, "points 3"]:
    shares = ((np.arange(count) + 0.5) / count)[:, None]
    return np.asarray(wall.start + shares * (wall.end - wall.start))


def seen(wall: Wall) -> SeenWall:
    return SeenWall(seen=wall, true=wall, through=())


def squared_error(error: np.ndarray, covariance: np.ndarray) -> float:
    return float(error[:2] @ np.linalg.solve(covariance[:2, :2], error[:2]))


def test_the_pilot_focused_on_a_scatterer_tells_its_distance_to_the_user() -> None:
    point = np.array([0.02, 0.52, 0.0])
    pilot = scattered_pilot(point[None], USER, 0)
    intensity, step = further_distances(pilot, point[None])
    distance = step * int(np.argmax(intensity[0]))
    # Half a sample, a quarter of a range cell apart.
    assert abs(distance - np.linalg.norm(USER - point)) <= 0.51 * step


def test_a_wall_that_scatters_all_over_locates_the_user() -> None:
    squared = []
    for seed in range(8):
        fix = search_diffuse(scattered_pilot(on(WALL), USER, seed), [seen(WALL)])
        assert fix is not None
        assert len(fix.rivals) == 0
        error = fix.position - USER
        # The range cell is c/B = 4 mm; it is told along the line of sight by many stretches.
        assert abs(error @ (USER - [0.0, 0.5, 0.0])) / np.linalg.norm(USER) < 1e-3
        squared.append(squared_error(error, fix.covariance))
    # The covariance is estimated from some ten stretches: Hotelling's T² with 2 and 10 degrees
    # has a mean of 2 · 10 / 8 = 2.5 and a deviation of 3.2, so that of 8 fixes is 1.1.
    assert 0.3 < np.mean(squared) < 2.5 + 3 * 1.1


def test_over_a_wall_seen_through_a_mirror_the_user_is_found_about_its_true_place() -> None:
    mirror = Wall(
        start=np.array([-0.05, 0.25, 0.0]),
        end=np.array([0.05, 0.35, 0.0]),
        covariance=WALL.covariance,
    )
    ends = mirrored(np.stack([WALL.start, WALL.end]), mirror.start, mirror.end)
    true = Wall(start=ends[0], end=ends[1], covariance=WALL.covariance)
    user = mirrored(USER, mirror.start, mirror.end)
    walls = [seen(mirror), SeenWall(seen=WALL, true=true, through=(0,))]
    fix = search_diffuse(scattered_pilot(on(WALL), USER, 3), walls)
    assert fix is not None
    assert fix.wall == 1
    assert squared_error(fix.position - user, fix.covariance) < 20  # 0.1 % of Hotelling's T²


@pytest.mark.parametrize("points", [1, 2, 5])
def test_a_few_bright_points_of_a_wall_locate_nobody(points: int) -> None:
    few = on(WALL, points)
    assert search_diffuse(scattered_pilot(few, USER, 1), [seen(WALL)]) is None


def test_a_direct_wave_is_not_taken_for_scattering() -> None:
    pilot = scattered_pilot(USER[None], USER, 2)
    assert search_diffuse(pilot, [seen(WALL)]) is None


def test_without_walls_nothing_is_searched() -> None:
    assert search_diffuse(scattered_pilot(on(WALL, 1), USER, 1), []) is None


def line(wall: Wall) -> FittedLine:
    return FittedLine(
        start=wall.start,
        end=wall.end,
        covariance=wall.covariance,
        level=1.0,
        background=1e-3,
        confidence=1.0,
    )


def test_the_diffuse_field_answers_where_no_path_stands_out() -> None:
    pilot = scattered_pilot(on(WALL), USER, 4)
    nothing = UserEstimate(name="user", status="not_found", reason="no wave stands out")
    answer = with_diffuse_search(nothing, pilot, [line(WALL)], [WALL], [()])
    # One wall tells the same distances of a place and of its image behind it: both are named.
    assert answer.status == "ambiguous"
    (behind,) = answer.alternatives
    assert behind.position is not None
    assert answer.position is not None
    np.testing.assert_allclose(WALL.mirrored(behind.position), answer.position, atol=1e-12)
    assert behind.probability is not None
    assert answer.probability is not None
    assert behind.probability < 0.1 < 0.5 < answer.probability < 0.999
    assert answer.method == "diffuse"
    assert answer.bounces == 1
    assert answer.position is not None
    assert answer.covariance is not None
    assert squared_error(answer.position - USER, answer.covariance) < 20


def path(share: float) -> PathReport:
    return PathReport(aoa=1.5, path_length=0.8, share=share, mirrors=(0,), used=True)


def test_an_answer_from_paths_that_the_diffuse_field_agrees_with_is_left_as_it_is() -> None:
    pilot = scattered_pilot(on(WALL), USER, 4)
    sharp = np.diag([1e-4, 1e-4, 0.0]) ** 2
    found = UserEstimate(
        name="user", status="found", position=USER, covariance=sharp, paths=(path(0.9),)
    )
    assert with_diffuse_search(found, pilot, [line(WALL)], [WALL], [()]) is found


def test_a_path_that_the_diffuse_field_contradicts_is_no_confident_answer() -> None:
    pilot = scattered_pilot(on(WALL), USER, 4)
    sharp = np.diag([1e-4, 1e-4, 0.0]) ** 2
    elsewhere = UserEstimate(
        name="user",
        status="found",
        position=np.array([0.2, 0.1, 0.0]),
        covariance=sharp,
        paths=(path(0.9),),
    )
    strong = with_diffuse_search(elsewhere, pilot, [line(WALL)], [WALL], [()])
    assert strong.status == "ambiguous"
    assert [one.method for one in strong.alternatives] == ["diffuse"]
    weak = replace(elsewhere, paths=(path(0.2),))
    answer = with_diffuse_search(weak, pilot, [line(WALL)], [WALL], [()])
    assert (answer.status, answer.method) == ("ambiguous", "diffuse")
    sure = replace(elsewhere, probability=0.99999)
    # Odds of 1e5 for the path, 3 to 2 against it: 0.999985 is left.
    kept = with_diffuse_search(sure, pilot, [line(WALL)], [WALL], [()])
    assert kept.status == "found"
    assert kept.probability == pytest.approx(0.999985, abs=1e-6)


def test_several_paths_that_agree_need_no_diffuse_search() -> None:
    pilot = scattered_pilot(on(WALL), USER, 4)
    two = UserEstimate(
        name="user",
        status="found",
        position=np.zeros(3),
        covariance=np.eye(3),
        paths=(path(0.5), path(0.4)),
    )
    assert with_diffuse_search(two, pilot, [line(WALL)], [WALL], [()]) is two


def test_of_ambiguous_places_the_one_that_the_diffuse_field_confirms_is_taken() -> None:
    pilot = scattered_pilot(on(WALL), USER, 4)
    sharp = np.diag([1e-4, 1e-4, 0.0]) ** 2
    wrong = UserEstimate(
        name="user", status="ambiguous", position=np.array([0.2, 0.1, 0.0]), covariance=sharp
    )
    right = UserEstimate(name="user", status="ambiguous", position=USER, covariance=sharp)
    both = UserEstimate(
        name="user",
        status="ambiguous",
        position=wrong.position,
        covariance=sharp,
        alternatives=(right,),
        reason="paths of like strength end at different places",
    )
    answer = with_diffuse_search(both, pilot, [line(WALL)], [WALL], [()])
    assert answer.status == "found"
    assert answer.method == "paths"
    np.testing.assert_array_equal(answer.position, USER)


def test_a_wide_place_that_agrees_by_chance_overrules_no_path_with_most_of_the_energy() -> None:
    pilot = scattered_pilot(on(WALL), USER, 4)
    wide = UserEstimate(
        name="user",
        status="ambiguous",
        position=USER + np.array([0.05, 0.0, 0.0]),
        covariance=np.diag([0.1, 0.1, 0.0]) ** 2,
        probability=0.15,
    )
    direct = UserEstimate(
        name="user",
        status="ambiguous",
        position=np.array([0.2, 0.1, 0.0]),
        covariance=np.diag([1e-4, 1e-4, 0.0]) ** 2,
        probability=0.85,
        alternatives=(wide,),
        paths=(path(0.93),),
    )
    answer = with_diffuse_search(direct, pilot, [line(WALL)], [WALL], [()])
    assert answer.status == "ambiguous"
    assert answer.position is not None
    np.testing.assert_array_equal(answer.position, direct.position)
    (other,) = answer.alternatives
    assert other.method == "diffuse"
    # Paths with little of it are given up, as before.
    weak = replace(direct, paths=(path(0.2),))
    assert with_diffuse_search(weak, pilot, [line(WALL)], [WALL], [()]).status == "found"
