"""Walls found in the echo of random points: speckle in closed form, no simulator."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.linear_array import echo_reach, echo_resolution, imaged_sine
from estimator.imaging.survey_2d import survey
from estimator.measurement.model import Echo, MeasurementError
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_refinement import refine_by_echo
from estimator.walls.line_relations import unassigned_peaks
from estimator.walls.wall_detection_2d import (
    LEAST_CELLS,
    LEAST_CONFIDENCE,
    detect_mirrors,
)

WALLS = 8


def found(echo: Echo) -> tuple[FittedLine, ...]:
    looked = survey(echo)
    return refine_by_echo(echo, looked, detect_mirrors(echo, looked))


def angle_of(line: FittedLine) -> float:
    """Angle of a line from +x, 0…180°. [degree]"""
    return float(np.degrees(np.arctan2(line.direction[1], line.direction[0])) % 180.0)


@dataclass
class Found:
    """One wall as it was found, against the truth."""

    line: FittedLine
    tilt: float  # counter-clockwise, found less true [rad]
    offset: float  # at the found midpoint, along its normal [m]
    ends: Float[np.ndarray, " 2"]  # how far the found ends reach beyond the true ones [m]
    cells: Float[np.ndarray, " 2"]  # resolution along the wall at its ends [m]


@pytest.fixture(scope="module")
def walls(world: Any) -> list[Found]:
    """Walls of 16 to 20 cm at all angles and distances that the array can see."""
    results = []
    for seed in range(WALLS):
        rng = np.random.default_rng(seed)
        middle, angle = (rng.uniform(-0.03, 0.03), rng.uniform(0.26, 0.3)), rng.uniform(-55, 55)
        length = rng.uniform(0.16, 0.2)
        echo = world.echo(world.rough_line(middle, angle, length, rng), rng)
        (line,) = found(echo)
        along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
        if line.direction @ along < 0:
            along = -along
        tilt = along[0] * line.direction[1] - along[1] * line.direction[0]
        normal = np.array([along[1], -along[0], 0.0])
        centre = np.array([*middle, 0.0])
        places = [float((end - centre) @ along) for end in (line.start, line.end)]
        ends = np.array([-places[0] - length / 2, places[1] - length / 2])
        resolution = echo_resolution(echo)
        cells = resolution.cell(np.stack([line.start, line.end]), line.direction)
        offset = float((line.middle - centre) @ normal)
        results.append(Found(line, float(tilt), offset, ends, cells))
    return results


def test_each_wall_is_found_once_and_for_certain(walls: list[Found]) -> None:
    assert len(walls) == WALLS  # the fixture unpacks exactly one line each
    for wall in walls:
        assert wall.line.confidence >= LEAST_CONFIDENCE
        assert wall.line.level > 100 * wall.line.background  # 20 dB of noise in each sample


def test_angle_and_offset_are_within_their_reported_deviations(walls: list[Found]) -> None:
    deviations = np.sqrt([np.diag(wall.line.covariance) for wall in walls])
    z = np.array([[wall.tilt, wall.offset] for wall in walls]) / deviations
    # With five blocks along such a short wall a deviation is itself known to 40 % only, and its
    # z follows Student's law with 3 degrees of freedom: rms 1.7 if the deviations are honest.
    # Far below, they would be useless; the lower limit allows them to be three times too large.
    rms = np.sqrt(np.mean(z**2, axis=0))
    assert np.all((rms > 0.3) & (rms < 1.7)), z
    assert np.all(np.abs(z.mean(axis=0)) < 4 / np.sqrt(WALLS)), z  # no bias
    assert np.abs(z).max() < 6  # 1 % of Student's law for each


def test_angle_and_offset_are_far_below_the_resolution_cell(walls: list[Found]) -> None:
    # The design's figures are for 40 cm and twice the aperture; here 0.05° and 0.05 mm (of 2 mm).
    errors = np.abs([[np.degrees(wall.tilt), 1e3 * wall.offset] for wall in walls])
    assert np.all(np.median(errors, axis=0) <= [0.03, 0.03]), errors
    assert np.all(errors.max(axis=0) <= [0.1, 0.1]), errors


def test_the_ends_are_found_to_a_cell_or_so(walls: list[Found]) -> None:
    beyond = np.array([wall.ends / wall.cells for wall in walls])
    assert abs(np.median(beyond)) <= 1.0, beyond
    # A wall's last cells may be dark. The taper widens a cell to one and a half: speckle below a
    # tenth of the mean in five of them has a probability of 0.1^(5/1.5) = 5e-4 for each end.
    assert np.all((beyond > -5.0) & (beyond < 2.0)), beyond


def test_a_mirrored_scene_has_mirrored_walls(world: Any) -> None:
    rng = np.random.default_rng(20)
    echo = world.echo(world.rough_line((0.02, 0.28), 35.0, 0.18, rng), rng)
    (line,) = found(echo)
    turned = Echo(
        samples=echo.samples[::-1].copy(), positions=echo.positions, frequencies=echo.frequencies
    )
    (other,) = found(turned)
    # The same data in another order; a search over a grid may stop at another of its points,
    # but both within a fraction of what the wall is known to.
    deviation = np.sqrt(np.diag(line.covariance))
    assert abs(angle_of(other) - (180 - angle_of(line))) <= np.degrees(0.2 * deviation[0])
    normal = np.array([line.direction[1], -line.direction[0], 0.0])
    assert abs((other.middle * [-1, 1, 1] - line.middle) @ normal) <= 0.2 * deviation[1]


@pytest.mark.parametrize("seed", range(6))
def test_noise_alone_has_no_walls(seed: int, world: Any) -> None:
    rng = np.random.default_rng(100 + seed)
    samples = world.noisy(np.full((96, world.band.size), 1e-12 + 0j), 0.0, rng)
    assert found(Echo(samples=samples, positions=world.array(), frequencies=world.band)) == ()


@pytest.mark.parametrize("count", [1, 3, 12])
@pytest.mark.parametrize("snr_db", [20.0, 60.0])
def test_point_targets_are_no_walls(count: int, snr_db: float, world: Any) -> None:
    # One bright point has sidelobes in a row along the ray and across it.
    rng = np.random.default_rng(count)
    points = np.column_stack([rng.uniform([-0.1, 0.2], [0.1, 0.4], (count, 2)), np.zeros(count)])
    assert found(world.echo(points, rng, snr_db=snr_db)) == ()


def test_a_bright_post_before_a_wall_does_not_pull_it(world: Any) -> None:
    # 20 dB above the whole wall, 4 cm before it: sidelobes cross it.
    rng = np.random.default_rng(7)
    wall = world.rough_line((0.0, 0.3), 45.0, 0.2, rng)
    alone = world.echo(wall, rng)
    post = world.echo(np.array([[0.03, 0.28, 0.0]]), rng, snr_db=200.0)
    gain = 10 * np.linalg.norm(alone.samples) / np.linalg.norm(post.samples)
    both = Echo(
        samples=alone.samples + gain * post.samples,
        positions=alone.positions,
        frequencies=alone.frequencies,
    )
    lines = found(both)
    assert len(lines) == 1
    assert angle_of(lines[0]) == pytest.approx(45.0, abs=0.1)
    assert abs((lines[0].middle - [0, 0.3, 0]) @ [1, -1, 0]) / np.sqrt(2) <= 1e-4


def test_two_walls_are_both_found(world: Any) -> None:
    rng = np.random.default_rng(5)
    points = [
        world.rough_line((-0.05, 0.3), 45.0, 0.12, rng, count=700),
        world.rough_line((0.12, 0.3), -45.0, 0.12, rng, count=700),
    ]
    lines = found(world.echo(np.concatenate(points), rng))
    assert len(lines) == 2
    first, second = sorted(lines, key=angle_of)
    for line, angle, middle in ((first, 45.0, -0.05), (second, 135.0, 0.12)):
        assert angle_of(line) == pytest.approx(angle, abs=0.1)
        np.testing.assert_allclose(line.middle, [middle, 0.3, 0], atol=3e-3)  # one cell
    assert lines[0].level >= lines[1].level  # the strongest first


@pytest.mark.parametrize(("gap", "count"), [(0.01, 1), (0.06, 2)])
def test_a_narrow_gap_is_bridged_and_a_doorway_divides_a_wall(
    gap: float, count: int, world: Any
) -> None:
    # The rule: 7 cells without a peak end a wall. A cell of the survey, which the taper widens,
    # is 4 mm along this wall, and the gap's edges light a cell each: 3.6 cm.
    rng = np.random.default_rng(5)
    points = world.rough_line((0.0, 0.3), 45.0, 0.24, rng)
    places = (points - [0, 0.3, 0]) @ (np.array([1, 1, 0]) / np.sqrt(2))
    lines = found(world.echo(points[np.abs(places) > gap / 2], rng))
    assert len(lines) == count
    for line in lines:
        assert angle_of(line) == pytest.approx(45.0, abs=0.2)
    inner = sorted(abs((end - [0, 0.3, 0]) @ (np.array([1, 1, 0]) / np.sqrt(2)))
                   for line in lines for end in (line.start, line.end))  # fmt: skip
    if count == 2:
        np.testing.assert_allclose(inner[:2], gap / 2, atol=6e-3)  # two cells


def test_a_wall_shorter_than_eight_cells_has_no_angle(world: Any) -> None:
    rng = np.random.default_rng(6)
    cell = float(echo_resolution(world.echo(np.ones((1, 3)), rng)).along_ray)
    short = 0.5 * LEAST_CELLS * cell
    assert found(world.echo(world.rough_line((0.0, 0.3), 60.0, short, rng, count=100), rng)) == ()


def test_the_survey_covers_what_can_be_imaged_and_sees_a_target(world: Any) -> None:
    target = np.array([[0.05, 0.33, 0.0]])
    echo = world.echo(target, np.random.default_rng(1), snr_db=60.0)
    looked = survey(echo)
    nearest, farthest = echo_reach(echo)
    ranges = np.linalg.norm(looked.points[:, 0], axis=-1)
    assert ranges[0] == pytest.approx(nearest)
    assert farthest - 2e-3 <= ranges[-1] < farthest
    # Pixels are at most three quarters of an untapered cell apart: c/2B, and λ/2D.
    assert np.diff(ranges).max() <= 0.75 * speed_of_light / (2 * 75e9) * 1.001
    brightest = np.unravel_index(int(np.argmax(np.abs(looked.values))), looked.values.shape)
    away = np.abs(looked.points[brightest] - target[0])
    resolution = echo_resolution(echo)
    assert away[1] <= resolution.along_ray
    assert away[0] <= 0.33 * resolution.across_ray
    assert np.linalg.norm(looked.peaks[0] - looked.points[brightest]) == 0


def test_the_resolution_and_the_reach_are_those_of_the_textbook(world: Any) -> None:
    echo = world.echo(np.array([[0.0, 0.3, 0.0]]), np.random.default_rng(1))
    resolution = echo_resolution(echo)
    assert resolution.along_ray == pytest.approx(speed_of_light / 150e9)  # c/2B = 2 mm
    # λ_c/2D, with D = 95 × 0.5 mm.
    assert resolution.across_ray == pytest.approx(speed_of_light / 257.5e9 / (2 * 47.5e-3))
    nearest, farthest = echo_reach(echo)
    assert nearest == pytest.approx(47.5e-3 / 2)
    assert farthest == pytest.approx(speed_of_light / (2 * 300e6) - 1.1 * 47.5e-3)
    # (2-22), corrected: Δx < λ_min/(4 sin φ).
    assert imaged_sine(echo) == pytest.approx(speed_of_light / 295e9 / (4 * 0.5e-3))


def test_loose_peaks_are_those_neither_on_a_wall_nor_behind_it(world: Any) -> None:
    rng = np.random.default_rng(9)
    wall = world.rough_line((0.0, 0.3), 45.0, 0.2, rng)
    before, behind = np.array([[0.08, 0.25, 0.0]]), np.array([[0.0, 0.38, 0.0]])
    echo = world.echo(
        np.concatenate([wall, np.repeat(np.concatenate([before, behind]), 8, 0)]), rng
    )
    looked = survey(echo)
    lines = detect_mirrors(echo, looked)
    assert len(lines) == 1
    unassigned = unassigned_peaks(echo, looked, lines)

    def nearest(points: Float[np.ndarray, "peaks 3"], place: Float[np.ndarray, "1 3"]) -> float:
        return float(np.linalg.norm(points - place, axis=-1).min())

    assert nearest(looked.peaks, before) < 4e-3
    assert nearest(looked.peaks, behind) < 4e-3
    assert nearest(unassigned, before) < 4e-3
    assert nearest(unassigned, behind) > 0.02
    # All of them, where there is no wall.
    np.testing.assert_array_equal(unassigned_peaks(echo, looked, ()), looked.peaks)


@pytest.mark.parametrize("points", [2, 11])
def test_a_frequency_step_too_coarse_for_any_range_is_refused(points: int, world: Any) -> None:
    # c/2Δf is 2 mm and 2 cm: less than the array's own size, so that nothing can be imaged.
    frequencies = np.linspace(220e9, 295e9, points)
    echo = world.echo(
        np.array([[0.0, 0.3, 0.0]]), np.random.default_rng(0), frequencies=frequencies
    )
    with pytest.raises(MeasurementError, match="frequency step"):
        survey(echo)


def test_a_wall_at_the_end_of_the_unambiguous_range_is_no_error(world: Any) -> None:
    # Trial lines beside it lie beyond what can be focused; the wall itself does not.
    rng = np.random.default_rng(5)
    echo = world.echo(
        world.rough_line((0.0, 0.44), 70.0, 0.15, rng), rng, positions=world.array(32)
    )
    for line in found(echo):
        assert angle_of(line) == pytest.approx(70.0, abs=1.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_few_glints_at_one_end_do_not_turn_a_wall(seed: int, world: Any) -> None:
    rng = np.random.default_rng(seed)
    middle, angle, length = np.array([0.0, 0.28, 0.0]), 35.0, 0.2
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    whole = world.rough_line((0.0, 0.28), angle, length, rng, rms=0.0)
    echo = world.echo(whole, rng, snr_db=40.0)
    samples = echo.samples
    for _ in range(4):
        x, y, _ = middle + rng.uniform(-0.5, -0.2) * length * along
        glint = world.rough_line((x, y), angle, 0.002, rng, rms=0.2e-3, count=30)
        samples = samples + 10 * world.echo(glint, rng, snr_db=60.0).samples
    echo = Echo(samples=samples, positions=echo.positions, frequencies=echo.frequencies)
    (line,) = detect_mirrors(echo, survey(echo))
    # A cell at its ends would be 0.7°: their sum of powers leads there, or nowhere.
    assert abs(angle_of(line) - angle) < 0.2
