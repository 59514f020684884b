"""Straight lines among peaks, on peaks that are thrown by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float

from estimator.array.resolution_cell import Resolution
from estimator.imaging.peak_detection import MOST_PEAKS, significant_peaks
from estimator.walls.line_detection import FEWEST_INLIERS, LineCandidate, find_lines

RESOLUTION = Resolution(along_ray=2e-3, across_ray=1e-2)  # 75 GHz; an aperture of 6 cm


def on_line(
    start: tuple[float, float],
    end: tuple[float, float],
    count: int,
    *,
    scatter: float = 0.2e-3,
    seed: int = 0,
) -> Float[np.ndarray, "peaks 3"]:
    rng = np.random.default_rng(seed)
    first, last = np.array([*start, 0.0]), np.array([*end, 0.0])
    # One peak about every cell, as speckle has them.
    places = (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / (count - 1)
    peaks = first + np.clip(places, 0, 1)[:, None] * (last - first)
    peaks[:, :2] += scatter * rng.standard_normal((count, 2))
    return np.asarray(peaks)


def thrown(count: int, seed: int) -> Float[np.ndarray, "peaks 3"]:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform([-0.4, 0.2], [0.4, 1.0], (count, 2)), np.zeros(count)])


def ends_of(line: LineCandidate) -> Float[np.ndarray, "2 2"]:
    """Its ends in the plane, the one with the smaller x first."""
    ends = np.stack([line.start, line.end])[:, :2]
    return np.asarray(ends[np.argsort(ends[:, 0])])


def test_the_cell_is_fine_along_the_ray_and_widens_with_range_across_it() -> None:
    points = np.array([[0.0, 0.5, 0.0], [0.0, 1.0, 0.0]])
    along, across = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(RESOLUTION.cell(points, along), [2e-3, 2e-3])
    np.testing.assert_allclose(RESOLUTION.cell(points, across), [5e-3, 10e-3])
    # At 45° an ellipse of those two axes: 1/√(½/a² + ½/b²).
    slanted = RESOLUTION.cell(points[:1], (along + across) / np.sqrt(2))
    assert slanted[0] == pytest.approx(np.sqrt(2) / np.hypot(1 / 2e-3, 1 / 5e-3))


@settings(deadline=None, max_examples=20)
@given(angle=st.floats(20, 160), seed=st.integers(0, 99))
def test_peaks_on_a_line_are_found_as_a_line_with_its_ends(angle: float, seed: int) -> None:
    half = 0.1 * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    middle = np.array([0.02, 0.6])
    peaks = on_line(tuple(middle - half), tuple(middle + half), 40, seed=seed)
    (line,) = find_lines(peaks, RESOLUTION)
    found = ends_of(line)
    expected = np.sort(np.stack([middle - half, middle + half])[:, 0])
    cell = RESOLUTION.cell(np.array([0.02, 0.6, 0.0]), np.array([*half, 0.0]) / 0.1)
    # The last peaks lie up to 1.3 spacings of 5 mm from the ends.
    np.testing.assert_allclose(found[:, 0], expected, atol=8e-3 + float(cell))
    along = found[1] - found[0]
    # Half a cell of slack over a length of 40 of them.
    assert abs(along @ [half[1], -half[0]]) / 0.1 <= 0.05 * np.linalg.norm(along)


def test_a_line_is_found_among_as_many_peaks_that_lie_anywhere() -> None:
    wall = on_line((-0.1, 0.5), (0.1, 0.7), 40)
    lines = find_lines(np.concatenate([thrown(60, 1), wall]), RESOLUTION)
    assert lines[0].inliers >= 36
    np.testing.assert_allclose(ends_of(lines[0]), [[-0.1, 0.5], [0.1, 0.7]], atol=0.02)


def test_two_lines_are_found_the_longer_first_and_share_no_peak() -> None:
    peaks = np.concatenate(
        [on_line((-0.3, 0.5), (-0.15, 0.6), 25), on_line((0.0, 0.9), (0.3, 0.7), 45, seed=1)]
    )
    lines = find_lines(peaks, RESOLUTION)
    assert len(lines) == 2
    np.testing.assert_allclose(ends_of(lines[0]), [[0.0, 0.9], [0.3, 0.7]], atol=0.02)
    np.testing.assert_allclose(ends_of(lines[1]), [[-0.3, 0.5], [-0.15, 0.6]], atol=0.02)
    assert sum(line.inliers for line in lines) <= len(peaks)


@pytest.mark.parametrize("seed", range(8))
def test_peaks_thrown_at_random_make_no_long_line(seed: int) -> None:
    # 30 peaks on an area of a thousand cells: eight in line are a matter of 1e-3.
    assert find_lines(thrown(30, seed), RESOLUTION) == ()


@pytest.mark.parametrize("count", [0, 1, FEWEST_INLIERS - 1])
def test_too_few_peaks_make_no_line(count: int) -> None:
    assert find_lines(thrown(count, 0), RESOLUTION) == ()


def test_peaks_in_one_cell_point_nowhere() -> None:
    bunch = np.array([0.1, 0.5, 0.0]) + 1e-3 * np.random.default_rng(0).standard_normal((30, 3)) * [
        1, 1, 0
    ]  # fmt: skip
    assert find_lines(bunch, RESOLUTION) == ()


def test_a_line_with_a_wide_gap_is_two_lines() -> None:
    # 12 cm across the ray: eight times the 7 cells of 2 mm that end a wall here.
    left, right = on_line((-0.25, 0.5), (-0.06, 0.5), 30), on_line((0.06, 0.5), (0.25, 0.5), 30)
    lines = find_lines(np.concatenate([left, right]), RESOLUTION)
    assert len(lines) == 2
    assert all(np.ptp(ends_of(line)[:, 0]) < 0.22 for line in lines)


def polar_points() -> Float[np.ndarray, "rows columns 3"]:
    ranges, sines = np.meshgrid(
        np.linspace(0.2, 1.0, 200), np.linspace(-0.9, 0.9, 150), indexing="ij"
    )
    points = np.zeros((200, 150, 3))
    points[..., 0], points[..., 1] = ranges * sines, ranges * np.sqrt(1 - sines**2)
    return points


def test_peaks_stand_out_of_the_background_the_strongest_first() -> None:
    rng, points = np.random.default_rng(3), polar_points()
    intensity = rng.exponential(size=points.shape[:2])
    intensity[50, 60], intensity[120, 30], intensity[120, 31] = 300.0, 500.0, 400.0
    peaks = significant_peaks(intensity, points)
    # 30 000 pixels of background exceed ln(1e6) = 13.8 times the mean with probability 3 %.
    np.testing.assert_array_equal(peaks, [points[120, 30], points[50, 60]])


@pytest.mark.parametrize("seed", range(5))
def test_background_alone_has_next_to_no_peaks(seed: int) -> None:
    intensity = np.random.default_rng(seed).exponential(size=(200, 150))
    # A mean of 0.03 peaks: two have a probability of 4e-4.
    assert len(significant_peaks(intensity, polar_points())) <= 1


def test_sidelobes_45_db_below_the_brightest_are_not_looked_at() -> None:
    points = polar_points()
    intensity = np.random.default_rng(3).exponential(size=points.shape[:2])
    intensity[50, 60], intensity[100, 100], intensity[150, 20] = 1e8, 1e4, 1e3
    peaks = significant_peaks(intensity, points)
    np.testing.assert_array_equal(peaks, [points[50, 60], points[100, 100]])


def test_no_more_than_the_strongest_peaks_are_searched() -> None:
    points = polar_points()
    intensity = np.random.default_rng(3).exponential(size=points.shape[:2])
    rows, columns = np.meshgrid(np.arange(2, 200, 4), np.arange(2, 150, 4), indexing="ij")
    intensity[rows, columns] = 1e3 + np.arange(rows.size).reshape(rows.shape)
    peaks = significant_peaks(intensity, points)
    assert len(peaks) == MOST_PEAKS
    np.testing.assert_array_equal(peaks[0], points[rows[-1, -1], columns[-1, -1]])
