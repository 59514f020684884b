"""A wall's line from its whole echo: closed forms of rows of scatterers, and walls of our own."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo
from estimator.walls.line_fit_echo import CoherentLine, fit_coherently
from estimator.walls.line_refinement import EXPLAINED

ELEMENTS, SPACING = 96, 0.5e-3
FREQUENCIES = np.linspace(220e9, 260e9, 161)
CELL = speed_of_light / (2 * 40e9)
LENGTH = 0.15
WALLS = 12


def _positions() -> np.ndarray:
    positions = np.zeros((ELEMENTS, 3))
    positions[:, 0] = (np.arange(ELEMENTS) - (ELEMENTS - 1) / 2) * SPACING
    return positions


def _ends(angle: float, centre: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    middle = np.array([*centre, 0.0])
    return middle - LENGTH / 2 * along, middle + LENGTH / 2 * along


def _echo(
    rng: np.random.Generator,
    start: np.ndarray,
    end: np.ndarray,
    *,
    depth: float = 0.0,
    noise: float = 0.0,
    apart: float = 0.0,
) -> Echo:
    """Echo of scatterers of random strength every 0.4 mm, with random depths of that deviation."""
    count = round(LENGTH / 0.4e-3)
    along = (end - start) / LENGTH
    normal = np.array([along[1], -along[0], 0.0])
    places = start + (np.arange(count) + 0.5)[:, None] / count * (end - start)
    places = places + rng.normal(scale=depth, size=(count, 1)) * normal
    strengths = rng.normal(size=count) + 1j * rng.normal(size=count)
    # Walls differ in level along them, by as much as range and incidence make them.
    strengths *= np.linspace(1.0, 3.0, count)
    transmitters = _positions() + np.array([apart, 0.0, 0.0])
    ranges = 0.5 * sum(
        np.linalg.norm(places[None] - ends[:, None], axis=-1)
        for ends in (_positions(), transmitters)
    )
    turns = np.exp(-4j * np.pi * (FREQUENCIES[1] - FREQUENCIES[0]) / speed_of_light * ranges)
    now = np.exp(-4j * np.pi * FREQUENCIES[0] / speed_of_light * ranges) * strengths
    samples = np.empty((ELEMENTS, len(FREQUENCIES)), dtype=complex)
    for column in samples.T:  # of the next frequency: each scatterer's phase turns on
        column[:] = now.sum(axis=1)
        now = now * turns
    level = np.sqrt(np.mean(np.abs(samples) ** 2) / 2)
    white = rng.normal(size=samples.shape) + 1j * rng.normal(size=samples.shape)
    samples += noise * level * white
    return Echo(
        samples=samples,
        positions=_positions(),
        frequencies=FREQUENCIES,
        transmit_positions=transmitters if apart else None,
    )


def _errors(line: CoherentLine, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Angle [rad] and offset at the middle [m], as :class:`CoherentLine` counts them."""
    along = (end - start) / np.linalg.norm(end - start)
    found = (line.end - line.start) / np.linalg.norm(line.end - line.start)
    normal = np.array([along[1], -along[0], 0.0])
    middle = 0.5 * (line.start + line.end) - 0.5 * (start + end)
    return np.array([along[0] * found[1] - along[1] * found[0], middle @ normal])


def _fit(echo: Echo, start: np.ndarray, end: np.ndarray) -> CoherentLine | None:
    """Fit from a line that is off by a few hundredths of a cell."""
    along = (end - start) / np.linalg.norm(end - start)
    normal = np.array([along[1], -along[0], 0.0])
    return fit_coherently(
        echo,
        start + 0.05 * CELL * normal,
        end - 0.03 * CELL * normal,
        cell_along=CELL,
        cell_across=CELL,
        beyond=(4 * CELL, 4 * CELL),
    )


def test_a_flat_wall_without_noise_is_found_however_its_speckle_falls() -> None:
    # A row of scatterers explains all of its own echo, and of no other line. What remains is the
    # first-order step's own error: (0.05 of a cell)² of a cell after two steps, and the ridge.
    rng = np.random.default_rng(1)
    for angle, centre in ((0.8, (0.0, 0.35)), (0.3, (0.05, 0.4)), (-0.6, (-0.05, 0.3))):
        start, end = _ends(angle, centre)
        for apart in (0.0, 0.05):  # transmitters, from their receivers
            line = _fit(_echo(rng, start, end, apart=apart), start, end)
            assert line is not None
            tilt, offset = _errors(line, start, end)
            assert abs(offset) < 2e-4 * CELL
            assert abs(tilt) < 4e-4 * CELL / LENGTH


def test_the_covariance_is_that_of_the_errors_for_noise_and_for_rough_heights() -> None:
    # 24 walls: the mean of a χ² of two degrees of freedom has a deviation of 2/√24 = 0.4, and
    # parts of a wall that push against each other leave the stated covariance too large.
    rng = np.random.default_rng(2)
    squares = []
    for depth, noise in ((30e-6, 0.0), (0.0, 3.0)):
        for _ in range(WALLS):
            angle = rng.uniform(0.5, 0.9)
            start, end = _ends(angle, (0.0, 0.35))
            line = _fit(_echo(rng, start, end, depth=depth, noise=noise), start, end)
            assert line is not None
            error = _errors(line, start, end)
            squares.append(error @ np.linalg.solve(line.covariance, error))
    assert 0.6 < np.mean(squares) < 3.0
    assert np.mean(np.array(squares) < 13.8) > 0.9  # 99.9 % region


@pytest.mark.parametrize(("noise", "depth", "explained"), [(1.0, 0.0, True), (1.0, 2e-3, False)])
def test_the_share_that_a_row_explains_is_that_of_the_echo_without_its_noise(
    noise: float, depth: float, explained: bool
) -> None:
    rng = np.random.default_rng(11)
    start, end = _ends(np.radians(25.0), (0.02, 0.35))
    line = _fit(_echo(rng, start, end, depth=depth, noise=noise), start, end)
    # At 0 dB for each sample noise is half of the energy; scatterers that are strewn 2 mm deep
    # (4 range phases of 2π) are no row. The noise is known to 2 %, and is as strong as the echo.
    assert line is not None
    assert (line.explained > EXPLAINED) == explained


def test_turning_the_list_of_ends_round_changes_nothing_but_the_signs() -> None:
    rng = np.random.default_rng(3)
    start, end = _ends(0.7, (0.0, 0.35))
    echo = _echo(rng, start, end, depth=20e-6)
    forth = fit_coherently(echo, start, end, cell_along=CELL, cell_across=CELL)
    back = fit_coherently(echo, end, start, cell_along=CELL, cell_across=CELL)
    assert forth is not None
    assert back is not None
    np.testing.assert_allclose(back.start, forth.end, atol=1e-4 * CELL)
    np.testing.assert_allclose(back.end, forth.start, atol=1e-4 * CELL)
    signs = np.array([[1.0, -1.0], [-1.0, 1.0]])
    np.testing.assert_allclose(back.covariance, signs * forth.covariance, rtol=1e-3)


def test_a_wall_that_goes_on_unseen_turns_its_line_unless_the_row_goes_on_too() -> None:
    rng = np.random.default_rng(4)
    start, end = _ends(0.8, (0.0, 0.35))
    echo = _echo(rng, start, end)
    shorter = start + 0.75 * (end - start)
    turned = fit_coherently(echo, start, shorter, cell_along=CELL, cell_across=CELL)
    held = fit_coherently(
        echo, start, shorter, cell_along=CELL, cell_across=CELL, beyond=(0.0, 0.3 * LENGTH)
    )
    assert held is not None
    assert abs(_errors(held, start, shorter)[0]) < 4e-4 * CELL / LENGTH
    assert turned is None or abs(_errors(turned, start, shorter)[0]) > 10 * abs(
        _errors(held, start, shorter)[0]
    )


@pytest.mark.parametrize("far", [2.0, 3.0])
def test_a_line_beside_its_echo_is_not_dragged_there(far: float) -> None:
    rng = np.random.default_rng(5)
    start, end = _ends(0.8, (0.0, 0.35))
    echo = _echo(rng, start, end)
    normal = np.array([end[1] - start[1], start[0] - end[0], 0.0]) / LENGTH
    aside = far * CELL * normal
    found = fit_coherently(echo, start + aside, end + aside, cell_along=CELL, cell_across=CELL)
    if found is not None:  # it stayed where it was
        assert np.linalg.norm(found.start - start - aside) <= 0.5 * CELL


def test_what_is_hardly_longer_than_a_point_has_no_line() -> None:
    rng = np.random.default_rng(6)
    start, end = _ends(0.8, (0.0, 0.35))
    echo = _echo(rng, start, end)
    near = start + 4 * CELL / LENGTH * (end - start)
    assert fit_coherently(echo, start, near, cell_along=CELL, cell_across=CELL) is None


@pytest.mark.parametrize("cable", [0.0, 3e-11, 1e-10])
def test_a_cable_left_in_the_echo_is_told_by_the_curvature_of_a_speckled_wall(
    cable: float,
) -> None:
    # Rough, inclined, of unknown strengths: only the defocus within each range cell tells.
    rng = np.random.default_rng(4)
    squares = []
    for angle in (0.6, 0.75, 0.9):
        start, end = _ends(angle, (0.0, 0.3))
        echo = _echo(rng, start, end, noise=0.1)
        echo = replace(echo, samples=echo.samples * np.exp(-2j * np.pi * FREQUENCIES * cable))
        shift = 0.5 * cable * speed_of_light
        # Imaged too far away along the rays, which the fit starts from.
        ends = [place * (1 + shift / np.linalg.norm(place)) for place in (start, end)]
        line = _fit(echo, *ends)
        assert line is not None
        squares.append(((line.late.shift - shift) / line.late.deviation) ** 2)
        # A millimetre, and a tenth of the shift for the one step.
        assert line.late.deviation < 1e-3 + 0.1 * abs(line.late.shift)
        if cable:
            assert line.late.shift > 3.3 * line.late.deviation
    # Three walls: of Gaussian errors one in 300 has one beyond 3.3 deviations.
    assert np.sqrt(np.max(squares)) < 3.3
