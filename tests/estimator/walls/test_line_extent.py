"""Ends of a flat face beside the shoulder of what is scattered twice."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.array.linear_array import echo_resolution
from estimator.imaging.backprojection import prepare
from estimator.imaging.focusing import focus_within
from estimator.imaging.range_compression import range_profiles
from estimator.measurement.model import Echo
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_extent import face_ends, likeliest_part

FAR = 0.33
FACE = -0.02, 0.01  # within what the array of 5 cm sees in reflection
FACE_STEP = 2e-4  # a sixth of the wavelength: the sum is a flat face's reflection


def ends(
    world: Any,
    line: tuple[float, float],
    shoulder: float,
    face: tuple[float, float] = FACE,
) -> tuple[FittedLine, Any]:
    """Return a line and the ends found on it, of a flat face and a shoulder 14 dB below it."""
    rng = np.random.default_rng(3)
    positions = world.array()
    wavenumber = 2 * np.pi * world.band / speed_of_light
    samples = np.zeros((len(positions), world.band.size), dtype=np.complex128)
    for x in np.arange(*face, FACE_STEP):
        ways = 2 * np.linalg.norm(positions - [x, FAR, 0.0], axis=-1)
        samples += FACE_STEP * np.exp(-1j * wavenumber * ways[:, None])
    # Each antenna sees √(λr/2) of a flat face, and a place of it is seen by as much of the array:
    # its image is that of a point of strength λr/2L, which is also the cell's width.
    cell = FAR * speed_of_light / world.band.mean() / 2 / np.ptp(positions[:, 0])
    for x in np.arange(face[1] + cell, shoulder, cell):
        ways = 2 * np.linalg.norm(positions - [x, FAR, 0.0], axis=-1)
        gain = 0.2 * cell * np.exp(2j * np.pi * rng.random())
        samples += gain * np.exp(-1j * wavenumber * ways[:, None])
    echo = Echo(samples=samples, positions=positions, frequencies=world.band)
    one = FittedLine(
        start=np.array([line[0], FAR, 0.0]),
        end=np.array([line[1], FAR, 0.0]),
        covariance=np.zeros((2, 2)),
        level=1.0,
        background=1e-3,
        confidence=1.0,
    )
    focus = focus_within(prepare(range_profiles(echo)), 1.0)
    half = 0.5 * np.ptp(positions[:, 0])
    return one, face_ends(one, focus, echo_resolution(echo), half)


@pytest.mark.parametrize("shoulder", [0.0, 0.025, 0.032])
def test_a_shoulder_is_cut_off_where_the_face_ends(world: Any, shoulder: float) -> None:
    line, (start, end) = ends(world, (FACE[0], max(shoulder, 0.025)), shoulder)
    cell = FAR * speed_of_light / world.band.mean() / 2 / np.ptp(world.array()[:, 0])
    assert start is line.start
    assert end == pytest.approx([FACE[1], FAR, 0.0], abs=cell)
    assert cell < 0.4 * (line.end[0] - FACE[1])  # leaving the line as it is would be wrong


def test_a_line_as_long_as_its_face_keeps_its_ends(world: Any) -> None:
    line, (start, end) = ends(world, FACE, 0.0)
    assert start is line.start
    assert end is line.end


def test_what_no_antenna_sees_in_reflection_is_no_end(world: Any) -> None:
    # A face twice as long as the array: beyond the array it is dim, but not at its end.
    line, (start, end) = ends(world, (-0.05, 0.05), 0.0, face=(-0.05, 0.05))
    assert start is line.start
    assert end is line.end


@pytest.mark.parametrize("level", [10.0, 100.0])
def test_of_a_line_in_noise_the_likeliest_part_is_the_wall(level: float) -> None:
    rng = np.random.default_rng(11)
    errors = []
    for _ in range(200):
        intensity = rng.exponential(1.0, 140)
        intensity[50:90] *= level
        first, last = likeliest_part(intensity, 10, 130)
        errors.append([first - 50, last - 89])
    # A wall's last places may be dark: one in six at 10 dB is no brighter than 2.2 dB over the
    # noise, and a place of noise is so bright with exp(-1.65) = 19 %.
    assert np.median(np.abs(errors)) <= 1
    assert np.mean(np.abs(errors) > 6) < 0.05


def test_a_wall_whose_level_falls_ends_where_it_is_no_brighter_than_noise() -> None:
    # A wall whose level falls by 40 dB along it is wall to where it is 2.2 dB over the noise.
    falling = 10 ** np.linspace(4.0, 0.0, 81)
    first, last = likeliest_part(falling, 0, 80)
    assert first == 0
    assert 10 * np.log10(falling[last]) == pytest.approx(2.2, abs=0.6)
