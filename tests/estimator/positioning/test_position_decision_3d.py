from dataclasses import replace

import numpy as np

from estimator.channel.path_extraction_3d import SpacePath
from estimator.geometry.wall_3d import PlaneWall, mirrored_about
from estimator.positioning.position_decision_3d import decide_in_space
from estimator.results.estimate import UserEstimate
from estimator.walls.plane_fit import plane_axes
from estimator.wavefronts.wave_fit_3d import Wavefront

USER = np.array([0.3, 0.9, 0.1])


def mirror(half: float = 0.6) -> PlaneWall:
    axes = plane_axes(np.array([0.5, -1.0, 0.0]) / np.sqrt(1.25))
    centre = np.array([0.0, 1.4, 0.0])
    corners = centre + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ axes
    return PlaneWall(
        corners=corners, centre=centre, axes=axes, covariance=np.diag([1e-7, 1e-7, 1e-8])
    )


def path_from(
    place: np.ndarray, share: float, *, curvature: float | None = None, deviation: float = 1e-4
) -> SpacePath:
    length = float(np.linalg.norm(place))
    wave = Wavefront(
        cosines=(float(place[0]) / length, float(place[2]) / length),
        path_length=length,
        curvature=1 / length,
        gain=1.0 + 0.0j,
        covariance=np.diag([deviation, deviation, deviation]) ** 2,
        explained=share,
        passes=1,
    )
    free = replace(
        wave,
        curvature=1 / length if curvature is None else curvature,
        covariance=np.diag([deviation, deviation, deviation, 1e-3]) ** 2,
    )
    return SpacePath(wave=wave, free=free, share=share, unambiguous=12.0)


def decided(paths: list[SpacePath], walls: list[PlaneWall], *, imaged: bool = True) -> UserEstimate:
    return decide_in_space("ann", paths, walls, cell=0.02, imaged=imaged)


def test_a_direct_path_and_one_over_a_wall_agree_and_are_joined() -> None:
    wall = mirror()
    paths = [path_from(USER, 0.7), path_from(mirrored_about(USER, wall), 0.3)]
    found = decided(paths, [wall])
    assert found.status == "found"
    assert found.position is not None
    assert found.covariance is not None
    np.testing.assert_allclose(found.position, USER, atol=1e-9)
    alone = decided(paths[:1], [wall])
    assert alone.covariance is not None
    assert np.trace(found.covariance) < np.trace(alone.covariance)


def test_a_longer_path_over_an_unseen_wall_does_not_shake_the_direct_one() -> None:
    unseen = mirrored_about(USER, mirror())
    found = decided([path_from(USER, 0.6), path_from(unseen, 0.4)], [])
    assert found.status == "found"
    assert found.bounces == 0


def test_a_shorter_path_of_like_strength_makes_the_answer_ambiguous() -> None:
    other = np.array([-0.2, 0.5, 0.0])
    found = decided([path_from(USER, 0.6), path_from(other, 0.4)], [])
    assert found.status == "ambiguous"
    (rival,) = found.alternatives
    assert rival.position is not None
    np.testing.assert_allclose(rival.position, other, atol=1e-9)


def test_a_path_at_a_walls_rim_has_both_answers() -> None:
    wall = mirror(half=0.6)
    rim = wall.centre + 0.595 * wall.axes[0]
    place = rim / np.linalg.norm(rim) * 2.2
    found = decided([path_from(place, 1.0)], [wall])
    assert found.status == "ambiguous"
    assert [other.bounces for other in found.alternatives] == [0]
    assert found.bounces == 1


def test_a_rounder_wave_is_no_users() -> None:
    found = decided([path_from(USER, 1.0, curvature=3.0)], [])
    assert found.status == "not_found"
    assert found.reason is not None
    assert "scatters it" in found.reason


def test_without_paths_or_without_an_echo_nothing_is_claimed() -> None:
    assert decided([], []).status == "not_found"
    assert decided([path_from(USER, 1.0)], [], imaged=False).status == "ambiguous"
