"""What a row of scatterers explains of the echo of random points, in closed form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.linear_array import echo_resolution
from estimator.geometry.wall_2d import mirrored
from estimator.imaging.range_compression import range_profiles
from estimator.walls.fitted_line import FittedLine
from estimator.walls.line_evidence import examine, gain_by_bending

MIDDLE = (0.02, 0.3)


def line_at(middle: tuple[float, float], angle_deg: float, length: float) -> FittedLine:
    along = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg)), 0.0])
    centre = np.array([*middle, 0.0])
    return FittedLine(
        start=centre - 0.5 * length * along,
        end=centre + 0.5 * length * along,
        covariance=np.eye(2),
        level=1.0,
        background=0.0,
        confidence=1.0,
    )


@pytest.mark.parametrize("angle_deg", [5.0, 35.0, 80.0])
def test_a_row_on_a_walls_line_explains_its_echo(angle_deg: float, world: Any) -> None:
    rng = np.random.default_rng(0)
    echo = world.echo(world.rough_line(MIDDLE, angle_deg, 0.12, rng), rng)
    found = examine(echo, line_at(MIDDLE, angle_deg, 0.12), echo_resolution(echo))
    # Heights of 0.05 mm, with phases of 4πσ/λ = 0.5 rad, are beyond the row: some σ⁴ of it.
    assert found.explained > 0.95


def test_a_row_beside_a_walls_line_explains_little(world: Any) -> None:
    rng = np.random.default_rng(1)
    echo = world.echo(world.rough_line(MIDDLE, 35.0, 0.12, rng), rng)
    across = 0.12 / np.sqrt(2) * np.sin(np.radians(20))  # of the ends of a row turned by 20°
    assert across > 4 * echo_resolution(echo).along_ray  # outside of the compared places
    found = examine(echo, line_at(MIDDLE, 55.0, 0.12), echo_resolution(echo))
    assert found.explained < 0.3


def test_echo_of_the_same_ranges_from_elsewhere_does_not_count(world: Any) -> None:
    rng = np.random.default_rng(2)
    wall: Float[np.ndarray, "points 3"] = world.rough_line(MIDDLE, 35.0, 0.12, rng)
    axis = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    both = np.concatenate([wall, mirrored(wall, axis[0], axis[1])[:300]])
    echo = world.echo(both, rng)
    found = examine(echo, line_at(MIDDLE, 35.0, 0.12), echo_resolution(echo))
    assert found.explained > 0.9


def test_the_depth_of_a_line_is_its_extent_in_range(world: Any) -> None:
    rng = np.random.default_rng(3)
    echo = world.echo(world.rough_line(MIDDLE, 0.0, 0.1, rng), rng)
    resolution = echo_resolution(echo)
    line = line_at((0.0, 0.3), 0.0, 0.1)
    # From the foot of the perpendicular at 0.3 m to an end.
    assert examine(echo, line, resolution).depth == pytest.approx(
        (np.hypot(0.3, 0.05) - 0.3) / resolution.along_ray
    )
    radial = replace(line, start=np.array([0.0, 0.25, 0.0]), end=np.array([0.0, 0.35, 0.0]))
    assert examine(echo, radial, resolution).depth == pytest.approx(0.1 / resolution.along_ray)


def test_waves_by_way_of_a_post_are_bent_and_a_walls_are_not(world: Any) -> None:
    rng = np.random.default_rng(2)
    facets = world.rough_line((0.06, 0.3), 60.0, 0.1, rng, count=200)
    echo = world.echo(facets, rng, snr_db=40.0)
    resolution = echo_resolution(echo)
    line = line_at((0.06, 0.3), 60.0, 0.1)
    profiles = range_profiles(echo)
    assert gain_by_bending(profiles, line, resolution) < 1.02
    # Out to a post, on to a facet, and straight back: a line at half the way and the mean sine.
    post = np.array([-0.07, 0.22, 0.0])
    legs = [
        np.linalg.norm(echo.positions[:, None] - places, axis=-1) for places in (post[None], facets)
    ]
    ways = legs[0] + legs[1] + np.linalg.norm(facets - post, axis=-1)
    strengths = rng.standard_normal(len(facets)) + 1j * rng.standard_normal(len(facets))
    turns = np.exp(-2j * np.pi / speed_of_light * ways[..., None] * echo.frequencies)
    twice = replace(echo, samples=np.einsum("mfn,f->mn", turns, strengths))
    reach = [np.linalg.norm(one) for one in (post, line.start, line.end)]
    ends = []
    for tip, far in zip((line.start, line.end), reach[1:], strict=True):
        half = 0.5 * (reach[0] + far + float(np.linalg.norm(tip - post)))
        sine = 0.5 * (post[0] / reach[0] + tip[0] / far)
        ends.append(half * np.array([sine, np.sqrt(1 - sine**2), 0.0]))
    seen = replace(line, start=ends[0], end=ends[1])
    assert gain_by_bending(range_profiles(twice), seen, resolution) > 1.1
