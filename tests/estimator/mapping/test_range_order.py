"""Planes that a band images nearer than they are: by curvature, by level, and as hypotheses."""

from typing import Any

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.planar_array import planar_array
from estimator.geometry.wall_3d import PlaneWall
from estimator.imaging.range_compression import range_profiles
from estimator.mapping.range_order import (
    farther,
    order_probabilities,
    other_distances,
    unambiguous_range,
)
from estimator.measurement.model import Echo

BAND = np.linspace(57e9, 64e9, 41)
STEP = speed_of_light / (2 * 175e6)  # 0.857 m


def positions(side: int, spacing: float = 2.4e-3) -> Float[np.ndarray, "elements 3"]:
    line = spacing * (np.arange(side) - (side - 1) / 2)
    x, z = np.meshgrid(line, line, indexing="ij")
    return np.stack([x.ravel(), np.zeros(side**2), z.ravel()], axis=-1)


def facing(distance: float, half: float = 0.2) -> PlaneWall:
    """A wall that the array meets head-on."""
    square = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    centre = np.array([0.0, distance, 0.0])
    return PlaneWall(
        corners=centre + square @ axes,
        centre=centre,
        axes=axes,
        covariance=np.diag([1e-3**2, 1e-3**2, 1e-4**2]),
    )


def reflection(distance: float, coefficient_db: float) -> Echo:
    """The echo of a large smooth wall met head-on, by its image: the same for all elements."""
    places = positions(16)
    level = 10 ** (coefficient_db / 20) * speed_of_light / BAND / (8 * np.pi * distance)
    samples = level * np.exp(-4j * np.pi * BAND * distance / speed_of_light)
    return Echo(samples=np.tile(samples, (len(places), 1)), positions=places, frequencies=BAND)


def orders_of(echo: Echo, wall: PlaneWall, peaks: Any = None, *, flat: bool = True) -> Any:
    found = np.zeros((0, 3)) if peaks is None else peaks
    return order_probabilities(
        wall,
        found,
        echo,
        planar_array(echo.positions),
        flat_wave=flat,
        profiles=range_profiles(echo),
    )


def test_the_reflection_alone_leaves_a_wall_at_several_distances() -> None:
    echo = reflection(0.2 + STEP, -1.0)
    assert unambiguous_range(echo) == pytest.approx(STEP)
    orders = orders_of(echo, facing(0.2))
    assert orders.sum() == pytest.approx(1.0)
    # 15.5 dB of loss at 0.2 m or 1 dB at 1.06 m, both of which walls have; more than that at none.
    assert orders[0] == pytest.approx(2 * orders[1])
    assert orders[2] < 0.3 * orders[1]


def test_a_level_that_only_a_better_than_perfect_mirror_farther_away_has_speaks_for_here() -> None:
    near, far = (orders_of(reflection(0.4, loss), facing(0.4))[0] for loss in (-1.0, -15.0))
    assert near > 0.8 > far
    # But antennas with gain, and uncalibrated echoes, have any level: never certain.
    assert near < 0.99


def scattered(place: Float[np.ndarray, " 3"], side: int) -> Echo:
    """The echo of one patch of a rough wall."""
    places = positions(side)
    lengths = np.linalg.norm(place - places, axis=-1)
    samples = np.exp(-4j * np.pi / speed_of_light * lengths[:, None] * BAND)
    return Echo(samples=samples, positions=places, frequencies=BAND)


@pytest.mark.parametrize("beyond", [False, True])
def test_what_a_wall_scatters_tells_how_far_it_is(beyond: bool) -> None:
    # An array of 113 mm: over it a wave from 0.5 m is 4 rad rounder than one from 1.36 m.
    rng = np.random.default_rng(4)
    seen = np.stack(
        [rng.uniform(-0.25, 0.25, 6), np.full(6, 0.5), 0.25 + rng.uniform(-0.1, 0.1, 6)], axis=-1
    )
    reach = np.linalg.norm(seen, axis=-1, keepdims=True)
    true = seen * (reach + STEP) / reach if beyond else seen
    parts = [scattered(place, 48) for place in true]
    phases = np.exp(2j * np.pi * rng.random(6))
    samples = sum(phase * part.samples for phase, part in zip(phases, parts, strict=True))
    echo = Echo(samples=samples, positions=parts[0].positions, frequencies=BAND)
    orders = orders_of(echo, facing(0.5), seen)
    if beyond:
        assert not orders.any()
    else:
        assert orders[0] == 1.0


def test_a_plane_of_peaks_of_which_nothing_tells_stands_where_it_is_imaged() -> None:
    assert orders_of(reflection(0.4, 0.0), facing(0.4), flat=False).tolist() == [1, 0, 0, 0]


def test_a_wall_farther_away_is_seen_in_the_same_directions() -> None:
    wall = farther(facing(0.2), STEP)
    assert wall.centre @ wall.normal == pytest.approx(
        facing(0.2).centre @ wall.normal * (1 + STEP / 0.2)
    )
    for one, other in zip(wall.corners, facing(0.2).corners, strict=True):
        np.testing.assert_allclose(np.cross(one, other), 0.0, atol=1e-12)
    # Met head-on at its centre, it turns about that: its offset errs as before.
    np.testing.assert_allclose(wall.covariance, facing(0.2).covariance)
    assert farther(wall, 0.0) is wall


def test_the_offset_of_a_wall_whose_foot_is_aside_errs_with_its_tilt_and_distance() -> None:
    square, shift = facing(0.2), np.array([0.1, 0.0, 0.0])
    aside = PlaneWall(
        corners=square.corners + shift,
        centre=square.centre + shift,
        axes=square.axes,
        covariance=np.diag([1e-3**2, 0.0, 0.0]),
    )
    moved = farther(aside, 0.2)
    # Twice as far, the centre is 0.2 m from the foot about which the plane turns: 0.1 m more.
    assert np.sqrt(moved.covariance[2, 2]) == pytest.approx(0.1 * 1e-3)


def test_all_combinations_of_distances_come_likeliest_first() -> None:
    walls = [facing(0.2), facing(0.4)]
    orders = [np.array([0.7, 0.3, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])]
    rooms = other_distances(walls, orders, STEP, most=8)
    assert [chance for chance, _ in rooms] == pytest.approx([0.7, 0.3])
    distances = [[float(wall.centre[1]) for wall in one] for _, one in rooms]
    assert distances == [pytest.approx([0.2, 0.4]), pytest.approx([0.2 + STEP, 0.4])]
    assert len(other_distances(walls, orders, STEP, most=1)) == 1
