from typing import Any

import numpy as np
import pytest
from scipy.constants import speed_of_light

from estimator.array.resolution_cell import Resolution
from estimator.geometry.specular_chains_3d import possible_chains
from estimator.geometry.wall_3d import PlaneWall, mirrored_about
from estimator.imaging.range_gating import gated
from estimator.mapping.ghost_correction import corrected_image
from estimator.mapping.map_3d import SpaceMap, mirrored_wall, other_rooms, unfold_planes
from estimator.measurement.model import Echo, Uplink
from estimator.walls.plane_detection import find_planes
from estimator.walls.plane_fit import FittedPlane, plane_axes
from estimator.walls.wall_detection_3d import wall_of_wave
from estimator.wavefronts.wave_fit_3d import Wavefront, towards

RESOLUTION = Resolution(along_ray=0.02, across_ray=0.02)


def square(centre: np.ndarray, normal: np.ndarray, half: float = 0.3) -> PlaneWall:
    axes = plane_axes(normal / np.linalg.norm(normal))
    corners = centre + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ axes
    return PlaneWall(corners=corners, centre=centre, axes=axes, covariance=np.zeros((3, 3)))


def test_planes_are_found_among_clutter_and_none_in_clutter_alone() -> None:
    rng = np.random.default_rng(3)
    clutter = rng.uniform([-0.5, 0.5, -0.5], [0.5, 4.5, 0.5], (150, 3))
    assert find_planes(clutter, RESOLUTION, depth=4.0, width=0.4) == ()
    wall = square(np.array([0.1, 2.0, 0.0]), np.array([0.5, -1.0, 0.1]))
    places = rng.uniform(-0.3, 0.3, (80, 2))
    rough = wall.centre + places @ wall.axes + rng.normal(0, 0.003, (80, 1)) * wall.normal
    (found,) = find_planes(np.vstack([clutter, rough]), RESOLUTION, depth=4.0, width=0.4)
    assert len(found.members) > 70
    # 80 peaks of 3 mm (and up to 15 mm of a few clutter points) over ±0.17 m: 0.3° and more.
    assert abs(found.normal @ wall.normal) > np.cos(np.radians(1.5))


def test_all_peaks_on_one_plane_are_still_a_plane() -> None:
    rng = np.random.default_rng(4)
    wall = square(np.array([0.0, 1.0, 0.0]), np.array([0.3, -1.0, 0.0]), half=0.2)
    peaks = wall.centre + rng.uniform(-0.2, 0.2, (40, 2)) @ wall.axes
    (found,) = find_planes(peaks, RESOLUTION, depth=1.5, width=0.4)
    assert len(found.members) == 40


def test_a_walls_ghost_unfolds_onto_it_with_its_covariance() -> None:
    mirror = square(np.array([0.0, 1.5, 0.0]), np.array([0.4, -1.0, 0.0]))
    spread = np.array([[4e-6, 1e-6, 2e-7], [1e-6, 9e-6, 0.0], [2e-7, 0.0, 1e-6]])
    true = square(np.array([0.8, 0.9, 0.1]), np.array([-1.0, -0.3, 0.2]))
    ghost = PlaneWall(
        corners=mirrored_about(true.corners, mirror),
        centre=mirrored_about(true.centre, mirror),
        axes=true.axes - 2 * np.outer(true.axes @ mirror.normal, mirror.normal),
        covariance=spread,
    )
    unfolded = mirrored_wall(ghost, mirror)
    np.testing.assert_allclose(unfolded.corners, true.corners, atol=1e-12)
    assert abs(unfolded.normal @ true.normal) == pytest.approx(1.0, abs=1e-12)
    # Oracle: move the ghost, mirror its corners; the unfolded wall's height there must have the
    # spread that its covariance claims.
    point = np.array([0.2, -0.1])
    at = np.array([*(unfolded.axes @ (true.axes.T @ point)), 1.0])
    heights = np.stack([point[0], point[1], 1.0])
    ghost_axes_height = heights @ spread @ heights
    assert at @ unfolded.covariance @ at == pytest.approx(ghost_axes_height, rel=1e-9)


def test_a_flat_waves_direction_error_tilts_the_wall_about_its_foot() -> None:
    spread = np.diag([1e-6, 4e-6, 9e-8])
    direction = towards(0.2, -0.1)
    wave = Wavefront(
        cosines=(0.2, -0.1),
        path_length=1.7,
        curvature=0.0,
        gain=1.0 + 0.0j,
        covariance=spread,
        explained=1.0,
        passes=2,
    )
    wall = wall_of_wave(wave, half=0.1)
    np.testing.assert_allclose(wall.centre, 1.7 * direction, atol=1e-12)
    # Oracle: the plane ŝ·p = d of a wave that is a little off, seen at a corner.
    corner = wall.corners[2]
    step = 1e-6
    slopes = []
    for change in np.eye(3) * step:
        moved = towards(0.2 + change[0], -0.1 + change[1])
        height = 1.7 + change[2] - moved @ corner
        slopes.append(height / step)
    expected = np.array(slopes) @ spread @ np.array(slopes)
    at = np.array([*((corner - wall.centre) @ wall.axes.T), 1.0])
    assert at @ wall.covariance @ at == pytest.approx(expected, rel=1e-3)


def test_a_ghost_behind_a_wall_moves_in_front_and_the_wall_stays(world: Any) -> None:
    mirror = square(np.array([0.0, 1.0, 0.0]), np.array([0.3, -1.0, 0.0]), half=0.4)
    true = np.array([0.25, 0.7, 0.0])
    ghost = mirrored_about(true, mirror)
    survey = world.volume(ghost, 0.04, np.linspace(0.2, 2.0, 91))
    places = np.stack([ghost, true])
    raw = np.abs(survey.at(places))
    assert raw[0] > 0.9  # interpolated linearly over half its width
    assert raw[1] < 1e-3
    chains = possible_chains([mirror])
    unfolded = np.abs(corrected_image(survey.at, places, [mirror], chains, skin=0.02).values)
    assert unfolded[0] == 0.0
    assert unfolded[1] == pytest.approx(raw[0], rel=1e-9)


def test_what_is_seen_in_a_wall_that_may_stand_farther_is_unfolded_in_each_of_its_places(
    world: Any,
) -> None:
    near = square(np.array([0.0, 0.4, 0.0]), np.array([0.0, -1.0, 0.0]))
    # Seen in it, 0.2 m behind its plane.
    ghost = square(np.array([0.05, 0.6, 0.0]), np.array([0.6, -0.8, 0.0]), half=0.05)
    orders = np.array([0.7, 0.3])
    planes = [
        FittedPlane(wall=wall, level=1.0, background=1e-3, area=50.0, confidence=1.0, orders=some)
        for wall, some in ((near, orders), (ghost, np.array([1.0, 0.0])))
    ]
    band = np.linspace(57e9, 64e9, 41)
    found = unfold_planes(planes, Resolution(along_ray=2e-2, across_ray=7e-2))
    room = SpaceMap(
        planes=found[0],
        walls=found[1],
        seen_through=found[2],
        joint_covariance=np.zeros((6, 6)),
        targets=(),
        unassigned_peaks=np.zeros((0, 3)),
        survey=world.volume(np.array([0.0, 0.4, 0.0]), 0.05, np.linspace(0.2, 0.8, 61)),
    )
    assert room.seen_through == ((), (0,))
    echo = Echo(
        samples=np.ones((4, band.size), dtype=complex),
        positions=np.array(
            [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.0, 0.01], [0.01, 0.0, 0.01]]
        ),
        frequencies=band,
    )
    (likely, here), (other, there) = other_rooms(room, echo)
    assert [likely, other] == pytest.approx([0.7, 0.3])
    assert here == room.walls
    step = speed_of_light / (2 * 175e6)
    np.testing.assert_allclose(there[0].centre, [0.0, 0.4 + step, 0.0])
    np.testing.assert_allclose(room.walls[1].centre, [0.05, 0.2, 0.0], atol=1e-12)
    # Before the farther one it is no image.
    np.testing.assert_allclose(there[1].centre, ghost.centre, atol=1e-12)


def test_a_gate_keeps_what_is_near_and_drops_what_is_far() -> None:
    frequencies = np.linspace(57e9, 64e9, 281)
    positions = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]])

    def pilot(length: float) -> Uplink:
        phase = -2j * np.pi * frequencies * length / speed_of_light
        samples = np.tile(np.exp(phase), (2, 1))
        return Uplink(samples=samples, positions=positions, frequencies=frequencies, user="a")

    near = gated(pilot(2.0), 2.1, reach=0.3)
    assert near.frequencies.size < 281 / 2.5
    expected = np.exp(-2j * np.pi * near.frequencies * 2.0 / speed_of_light)
    # A Hann block of two hops is down by 1 dB (0.11) at the reach, less at a third of it.
    np.testing.assert_allclose(near.samples[0], expected, atol=0.05)
    far = gated(pilot(8.0), 2.1, reach=0.3)
    assert np.abs(far.samples).max() < 10 ** (-30 / 20)  # beyond its highest sidelobe, −31 dB


def test_too_few_frequencies_are_not_gated() -> None:
    echo = Echo(
        samples=np.ones((2, 12), dtype=np.complex128),
        positions=np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]]),
        frequencies=np.linspace(57e9, 64e9, 12),
    )
    assert gated(echo, 0.1, reach=0.05) is echo
