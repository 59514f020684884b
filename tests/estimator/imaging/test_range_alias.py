"""Echoes of points beyond the unambiguous range, in closed form."""

from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.array.linear_array import echo_resolution
from estimator.imaging.range_alias import ARC, brightest_from_beyond, focus_by_range
from estimator.imaging.range_compression import range_profiles
from estimator.imaging.survey_2d import survey
from estimator.localization.aliasing import range_notes
from estimator.measurement.model import Echo
from estimator.walls.wall_detection_2d import detect_mirrors

PLACE = np.array([0.06, 0.25, 0.0])


def beyond(place: np.ndarray, echo: Echo) -> np.ndarray:
    """The place one unambiguous range farther, on the same ray."""
    step = float(echo.frequencies[1] - echo.frequencies[0])
    reach = np.linalg.norm(place)
    farther: np.ndarray = place * (reach + speed_of_light / (2 * step)) / reach
    return farther


@pytest.mark.parametrize("farther", [False, True])
def test_a_point_is_focused_best_at_its_true_range(farther: bool, world: Any) -> None:
    rng = np.random.default_rng(0)
    echo = world.echo(PLACE[None], rng)
    if farther:
        echo = world.echo(beyond(PLACE, echo)[None], rng)
    found = focus_by_range(range_profiles(echo), PLACE[None], echo_resolution(echo))
    # Half the array is 24 mm: k h² (1/r − 1/(r + 0.5 m)) is 8 rad at its ends, which takes 10 dB.
    best, other = (found.beyond, found.here) if farther else (found.here, found.beyond)
    assert best[0] > 4 * other[0]
    assert found.is_beyond(np.array([True])) == farther
    assert found.flat[0] < best[0]


def test_a_flat_wave_is_of_no_point_beyond(world: Any) -> None:
    # A mirror that faces the array returns to each position what it sent: one range for all.
    positions = world.array(96)
    turns = np.exp(-4j * np.pi * world.band * 0.25 / speed_of_light)
    echo = Echo(
        samples=np.tile(turns, (len(positions), 1)), positions=positions, frequencies=world.band
    )
    place = np.array([[0.0, 0.25, 0.0]])
    found = focus_by_range(range_profiles(echo), place, echo_resolution(echo))
    # Each profile is read where the point's would peak, up to h²/2r too far: half a cell.
    late = positions[:, 0] ** 2 / (2 * 0.25) / echo_resolution(echo).along_ray
    assert found.flat[0] == pytest.approx(np.mean(np.sinc(late)) ** 2, abs=0.02)  # ranges tried
    assert found.flat[0] > found.beyond[0] > found.here[0]
    assert not found.is_beyond(np.array([True]))


@pytest.mark.parametrize("share", [1.0, 0.6])
def test_the_reflection_of_a_part_of_the_array_is_of_no_point_beyond(
    share: float, world: Any
) -> None:
    # Its peaks lie beside its direction, by more than half a cell: there a wave from beyond, which
    # is bent, seemed to fit where a flat one was tried in the peak's own direction alone.
    rng = np.random.default_rng(4)
    positions = world.array(96)
    lit = np.arange(96) < share * 96
    ways = 2 * (0.25 + np.sin(np.radians(10.0)) * positions[:, 0])
    waves = np.exp(-2j * np.pi * world.band / speed_of_light * ways[:, None]) * lit[:, None]
    noisy = world.noisy(waves, 20.0, rng)
    looked = survey(Echo(samples=noisy, positions=positions, frequencies=world.band))
    assert looked.reflected[0]
    assert not looked.beyond[0]


def test_a_wall_beyond_the_unambiguous_range_is_no_mirror_nearby(world: Any) -> None:
    rng = np.random.default_rng(1)
    near = world.echo(world.rough_line((0.0, 0.25), 30.0, 0.12, rng), rng)
    far = world.echo(world.rough_line((0.0, 0.75), 30.0, 0.3, rng), rng)
    looked = survey(near)
    assert len(detect_mirrors(near, looked)) == 1
    assert not looked.beyond.any()
    assert range_notes(near, looked.beyond) == ()
    looked = survey(far)
    assert detect_mirrors(far, looked) == ()
    assert np.mean(looked.beyond) > 0.8
    (note,) = range_notes(far, looked.beyond)
    assert "0.5 m" in note


@pytest.mark.parametrize("farther", [False, True])
def test_an_arc_beside_the_array_is_told_from_a_post_there(farther: bool, world: Any) -> None:
    # Half an aperture away, a wave from beyond is spread over half of all directions.
    rng = np.random.default_rng(3)
    place = np.array([-0.008, 0.030, 0.0])
    echo = world.echo(place[None], rng)
    if farther:
        echo = world.echo(beyond(place, echo)[None], rng)
    cell = echo_resolution(echo).along_ray
    ranges = np.arange(0.026, 0.036, 0.75 * cell)
    ratio = brightest_from_beyond(range_profiles(echo), ranges, np.linspace(-0.6, 0.6, 201))
    # k h² (1/r − 1/(r + 0.5 m)) is 90 rad at the ends of 24 mm: spread over some 30 cells across.
    assert (ratio > ARC) == farther
    assert ratio > 5 if farther else ratio < 0.5
